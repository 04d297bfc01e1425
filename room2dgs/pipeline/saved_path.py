"""Views that a person kept in the viewer, as a smooth path that `room2dgs render path=FILE` reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from room2dgs.captures.world_offset import Origin, camera_in_world
from room2dgs.export.transforms_json import OPENGL_FROM_OPENCV
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.camera_path import smooth_path

PATH = "path.json"
STEPS = 60  # pictures from a view to the next


def write_path(views: Sequence[Camera], origin_m: Origin, path: Path) -> int:
    """A transforms.json of cameras through the views, in the capture's world.

    Args:
        views: two or more; their size and intrinsics are the first's.
        origin_m: `Scene.origin_m` of the views.

    Returns:
        The number of pictures.
    """
    cameras = [camera_in_world(camera, origin_m) for camera in smooth_path(views, STEPS * (len(views) - 1) + 1)]
    K = cameras[0].K
    meta = {
        "camera_model": "PINHOLE",
        "w": cameras[0].width,
        "h": cameras[0].height,
        "fl_x": K[0, 0],
        "fl_y": K[1, 1],
        "cx": K[0, 2],
        "cy": K[1, 2],
        "frames": [
            {
                "file_path": f"{number:05d}.png",
                "transform_matrix": (camera.world_from_cam @ OPENGL_FROM_OPENCV).tolist(),
            }
            for number, camera in enumerate(cameras)
        ],
    }
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(meta) + "\n", encoding="utf-8")
    return len(cameras)
