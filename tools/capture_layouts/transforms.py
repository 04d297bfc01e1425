"""nerfstudio's and instant-ngp's transforms.json."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from room2dgs.tools.capture_layouts.made import GL, Made, image_file, lists, photo_file


def named_intrinsics(made: Made) -> dict[str, float]:
    return dict(zip(("fl_x", "fl_y", "cx", "cy"), made.fx_fy_cx_cy, strict=True))


def nerfstudio(root: Path, made: Made) -> None:
    """OpenGL axes; the saved world is (x, z, -y) of the capture's, at half its size."""
    applied = np.array([[1.0, 0, 0, 0.1], [0, 0, 1, 0.2], [0, -1, 0, -0.3]])
    frames = []
    for i, pose in enumerate(made.poses):
        photo_file(root / f"images/frame_{i + 8:05d}.png", made, i)
        image_file(root / f"depth/frame_{i + 8:05d}.png", made.depths[i])
        saved = np.eye(4)
        saved[:3, :3] = applied[:, :3] @ pose[:3, :3]
        saved[:3, 3] = 0.5 * (applied[:, :3] @ pose[:3, 3] + applied[:, 3])
        frames.append(
            {
                "file_path": f"images/frame_{i + 8:05d}.png",
                "depth_file_path": f"depth/frame_{i + 8:05d}.png",
                "transform_matrix": lists(saved @ GL),
            }
        )
    meta = {"w": made.width, "h": made.height, **named_intrinsics(made), "camera_model": "OPENCV"}
    meta |= {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0, "applied_transform": applied.tolist(), "applied_scale": 0.5}
    (root / "transforms.json").write_text(json.dumps({**meta, "frames": frames[::-1]}))


def instant_ngp(root: Path, made: Made) -> None:
    """Fields of view, no suffix, 3x4 matrices, intrinsics a frame."""
    root.mkdir(parents=True)
    fx, fy, cx, cy = made.fx_fy_cx_cy
    frames: list[dict[str, object]] = []
    for i, pose in enumerate(made.poses):
        photo_file(root / f"images/{i + 8}.png", made, i)
        frames.append({"file_path": f"./images/{i + 8}", "transform_matrix": lists((pose @ GL)[:3])})
        frames[-1] |= {
            "camera_angle_x": 2 * np.arctan(made.width / 2 / fx),
            "y_fov": np.degrees(2 * np.arctan(made.height / 2 / fy)),
        }
        frames[-1] |= {"cx": cx, "cy": cy}
    (root / "transforms.json").write_text(json.dumps({"frames": frames, "aabb_scale": 4}))
