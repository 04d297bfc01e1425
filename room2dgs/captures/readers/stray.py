"""Stray Scanner: rgb.mp4, camera_matrix.csv, odometry.csv, depth/000000.png.

Poses are camera-to-world with OpenCV axes, metres (StrayVisualizer hands their inverse to a projection as it is). A
line of odometry.csv and a depth map belong to each frame of the video; newer apps add intrinsics to the lines.
"""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Shot, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, listed
from room2dgs.captures.photos import Video, VideoFrame
from room2dgs.captures.text_files import floats, lines_of, number, quaternion_pose, text_of
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "rgb.mp4, camera_matrix.csv and odometry.csv (Stray Scanner)"
COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def is_stray(files: Listing) -> bool:
    return "odometry.csv" in files and ("rgb.mp4" in files or "camera_matrix.csv" in files)


def read_stray(root: Path, config: SceneConfig) -> Capture:
    """Read a scan.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    video = Video(root / "rgb.mp4")
    path = root / "odometry.csv"
    try:
        known = list(csv.DictReader(StringIO(text_of(path).replace("\0", "")), skipinitialspace=True))
    except csv.Error as error:
        raise InputError(f"{path} is no table ({error}); copy the scan again") from error
    if not known or any(column not in known[0] for column in COLUMNS):
        raise InputError(f"{path} has no columns {', '.join(COLUMNS)}; copy the scan again")
    half = config.pixel_centres != "integer"
    lens = _lens(root / "camera_matrix.csv", half)
    depths = listed(root / "depth")
    shots = []
    for line, row in enumerate(known):
        label = f"{path} line {line + 2}"
        x, y, z, w = (_value(row, key, label) for key in COLUMNS[3:])
        pose = quaternion_pose(x, y, z, w, [_value(row, key, label) for key in COLUMNS[:3]], label)
        index = int(number(row, "frame", label)) if (row.get("frame") or "").strip() else line
        if not 0 <= index < 10**8:
            raise InputError(f"{label} names frame {index}; copy the scan again")
        own = lens
        if all((row.get(key) or "").strip() for key in ("fx", "fy", "cx", "cy")):
            own = pinhole_lens(*(number(row, key, label) for key in ("fx", "fy", "cx", "cy")), None, path, half)
        stem = f"{index:06d}"
        depth = next((f"{stem}{end}" for end in (".png", ".npy") if f"{stem}{end}" in depths), None)
        shots.append(
            Shot(
                stem,
                root / "rgb" / f"{stem}.jpg",
                pose,
                own,
                VideoFrame(video, index),
                depth_file(root / "depth" / depth) if depth else None,
            )
        )
    return Capture(root, "stray", shots, gt_mesh=gt_mesh_in(root), why="ARKit's poses are metres")


def _value(row: dict, key: str, label: str) -> float:
    try:
        return float(row[key])
    except (TypeError, ValueError) as error:
        raise InputError(f"{label} has no number as {key}; copy the scan again") from error


def _lens(path: Path, half: bool):
    rows = np.array([floats(text, path, line, 3) for line, text in lines_of(path)])
    if rows.shape != (3, 3):
        raise InputError(f"{path} is no 3x3 matrix; copy the scan again")
    return pinhole_lens(rows[0, 0], rows[1, 1], rows[0, 2], rows[1, 2], None, path, half)
