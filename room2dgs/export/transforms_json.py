"""The prepared capture as nerfstudio's transforms.json, with its photos and sparse points."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import trimesh

from room2dgs.captures.world_offset import AT_ORIGIN
from room2dgs.export.photos import write_masks, write_photos
from room2dgs.export.source import Source
from room2dgs.files import whole_file

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
POINTS = "sparse_points.ply"


def write_transforms(source: Source, folder: Path) -> list[Path]:
    """transforms.json (camera-to-world, OpenGL axes, metres, the capture's own world), images/, sparse points.

    Of a scene far from its world's origin, poses and points count from a point beside it, as its trainers' float32
    needs it; `applied_transform` is the way there from the capture's world, which nerfstudio and we take back.
    """
    scene = source.scene
    names = write_photos(scene.frames, folder / "images")
    masks = write_masks(scene.frames, folder / "masks", names)
    frames = []
    for frame in scene.frames:
        K = frame.camera.K
        frames.append(
            {
                "file_path": f"images/{names[frame.name]}",
                "w": frame.camera.width,
                "h": frame.camera.height,
                "fl_x": K[0, 0],
                "fl_y": K[1, 1],
                "cx": K[0, 2],
                "cy": K[1, 2],
                "transform_matrix": (frame.camera.world_from_cam @ OPENGL_FROM_OPENCV).tolist(),
                **({"mask_path": f"masks/{masks[frame.name]}"} if frame.name in masks else {}),
            }
        )
    parts = {}
    if scene.test:  # nerfstudio wants all three or none, and evaluates on "val"
        parts = {"train_filenames": scene.train, "val_filenames": scene.test, "test_filenames": scene.test}
    meta = {
        "camera_model": "OPENCV",
        **{key: 0.0 for key in ("k1", "k2", "p1", "p2")},
        "applied_transform": np.column_stack([np.eye(3), 0.0 - np.array(scene.origin_m)]).tolist(),
        "ply_file_path": POINTS,
        **{key: [f"images/{names[frame.name]}" for frame in part] for key, part in parts.items()},
        "frames": frames,
    }
    cloud = trimesh.PointCloud(source.points.xyz, colors=source.points.rgb)
    with whole_file(folder / POINTS) as temporary:
        temporary.write_bytes(trimesh.exchange.ply.export_ply(cloud))
    if scene.origin_m != AT_ORIGIN:
        source.log("transforms.json: poses and points are near the scene; applied_transform leads there from the world")
    with whole_file(folder / "transforms.json") as temporary:
        temporary.write_text(json.dumps(meta, indent=1) + "\n", encoding="utf-8")
    pictures = [folder / "images" / name for name in names.values()]
    return [folder / "transforms.json", folder / POINTS, *pictures, *(folder / "masks" / one for one in masks.values())]
