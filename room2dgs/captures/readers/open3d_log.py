"""Redwood's, Open3D's and Azure Kinect's captures: color/ (or image/), depth/, and a trajectory .log.

The trajectory has five lines a frame: three numbers, then camera-to-world, OpenCV axes, metres. Depth is millimetres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Shot, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural, photos_in
from room2dgs.captures.text_files import floats, lines_of, number, numbers, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "color/, depth/ and scene/trajectory.log (Open3D)"
LOGS = ("scene/trajectory.log", "trajectory.log")
PHOTOS = ("color", "image", "rgb", "images")
INTRINSICS = ("intrinsic.json", "camera_intrinsic.json", "intrinsics.json")


def is_open3d(files: Listing) -> bool:
    return any(name in files for name in LOGS)


def read_open3d(root: Path, config: SceneConfig) -> Capture:
    """Read a capture with a .log.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path = next((root / name for name in LOGS if (root / name).is_file()), root / LOGS[0])
    lines = lines_of(path)
    if len(lines) % 5 or not lines:
        raise InputError(f"{path} has {len(lines)} lines, 5 a frame belong there; copy it again")
    folder = next((root / name for name in PHOTOS if (root / name).is_dir()), root / PHOTOS[0])
    photos = photos_in(folder)
    depths = natural(name for name in listed(root / "depth") if name.endswith(".png"))
    if depths and len(depths) != len(photos):
        raise InputError(f"{root / 'depth'} has {len(depths)} maps for {len(photos)} photos; copy the capture again")
    lens = _lens(root, config)
    shots = []
    for start in range(0, len(lines), 5):
        head = floats(lines[start][1], path, lines[start][0])
        index = int(head[0]) if head and 0 <= head[0] < 1e9 else -1
        if not 0 <= index < len(photos):
            raise InputError(f"{path} line {lines[start][0]} names frame {index}, {folder} has {len(photos)} photos")
        rows = [floats(text, path, line, 4) for line, text in lines[start + 1 : start + 5]]
        depth = depth_file(root / "depth" / depths[index]) if depths else None
        shots.append(Shot(photos[index], folder / photos[index], np.array(rows), lens, depth=depth))
    return Capture(root, "open3d", shots, gt_mesh=gt_mesh_in(root), why="Open3D's trajectories are metres")


def _lens(root: Path, config: SceneConfig):
    """Open3D's own intrinsic.json, whose matrix goes down the columns."""
    for name in INTRINSICS:
        path = root / name
        if path.is_file():
            known = read_json_object(path)
            size = int(number(known, "width", path)), int(number(known, "height", path))
            K = numbers(known, "intrinsic_matrix", 9, path).reshape(3, 3).T
            return pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], size, path, config.pixel_centres == "half")
    return None
