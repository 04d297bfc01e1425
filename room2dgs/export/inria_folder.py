"""The folder that the first splatting code leaves, for its viewers and those of 2DGS; in the capture's own world."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from room2dgs.captures.world_offset import AT_ORIGIN
from room2dgs.export.gaussian_ply import gaussian_ply
from room2dgs.export.local_files import write_offset
from room2dgs.export.source import Source
from room2dgs.files import whole_file

SH_DEGREE = 3  # what the loaders assume unless told otherwise


def write_inria(source: Source, folder: Path) -> list[Path]:
    """point_cloud/iteration_<n>/point_cloud.ply with harmonics of degree 3, cameras.json, cfg_args."""
    iteration = source.config.train.iterations
    cloud = folder / "point_cloud" / f"iteration_{iteration}" / "point_cloud.ply"
    cameras = []
    for number, frame in enumerate(source.scene.frames):
        pose, K = frame.camera.world_from_cam, frame.camera.K
        cameras.append(
            {
                "id": number,
                "img_name": frame.name,
                "width": frame.camera.width,
                "height": frame.camera.height,
                "position": pose[:3, 3].tolist(),
                "rotation": pose[:3, :3].tolist(),
                "fy": K[1, 1],
                "fx": K[0, 0],
            }
        )
    white = all(value > 0.5 for value in source.config.render.background)
    settings = {
        "sh_degree": SH_DEGREE,
        "source_path": str(source.scene.path),
        "model_path": str(folder),
        "images": "images",
        "resolution": -1,
        "white_background": white,
        "data_device": "cpu",
        "eval": False,
    }
    arguments = ", ".join(f"{key}={value!r}" for key, value in settings.items())
    far = () if source.origin_m == AT_ORIGIN else source.comments(np.eye(3))
    contents = {
        cloud: gaussian_ply(source.surfels, comments=far, sh_degree=SH_DEGREE),
        folder / "cameras.json": (json.dumps(cameras) + "\n").encode(),
        folder / "cfg_args": f"Namespace({arguments})".encode(),
    }
    for path, data in contents.items():
        with whole_file(path) as temporary:
            temporary.write_bytes(data)
    return [*contents, *write_offset(source, cloud, np.eye(3))]
