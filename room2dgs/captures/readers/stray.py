"""Stray Scanner: rgb.mp4, camera_matrix.csv, odometry.csv, depth/000000.png.

Poses are camera-to-world with OpenCV axes, metres (StrayVisualizer hands their inverse to a projection as it is). A
line of odometry.csv and a depth map belong to each frame of the video, by its number; the oldest apps wrote none, and
then there must be a line a frame. Newer apps add intrinsics to the lines.

Photos in rgb/, called by those numbers, stand in for a video that is not there.
"""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.captures.capture import Capture, Shot, lost, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.known_keys import unknown_keys
from room2dgs.captures.left_out import left_out
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, photos_in
from room2dgs.captures.pairing import alike
from room2dgs.captures.photos import Video, VideoFrame
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import floats, lines_of, number, quaternion_pose, text_of
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "rgb.mp4, camera_matrix.csv and odometry.csv (Stray Scanner)"
COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
KNOWN = {"timestamp", "frame", *COLUMNS, "fx", "fy", "cx", "cy"}
DEPTHS = (".png", ".npy")


def is_stray(files: Listing) -> bool:
    return "odometry.csv" in files and ("rgb.mp4" in files or "camera_matrix.csv" in files)


def read_stray(root: Path, config: SceneConfig) -> Capture:
    """Read a scan.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    video = Video(root / "rgb.mp4")
    path = root / "odometry.csv"
    rows, columns = _table(path)
    notes = [message for message in [unknown_keys(columns, KNOWN, path)] if message]
    if any(column not in columns for column in COLUMNS):
        raise InputError(f"{path} has no columns {', '.join(COLUMNS)}; copy the scan again")
    files = [] if video.path.exists() else photos_in(root / "rgb")  # taken out of the video
    count = len(files) or len(video)
    if "frame" not in columns and count != len(rows):
        raise InputError(
            f"{path} has {len(rows)} poses and no column frame, and {'rgb/' if files else video.path.name} has {count} "
            f"{'photos' if files else 'frames'}; which is whose cannot be told, copy the scan again"
        )
    half = config.pixel_centres != "integer"
    lens = _lens(root / "camera_matrix.csv", half)
    lines: dict[int, _Line] = {}
    bad: dict[str, str] = {}
    for place, row in enumerate(rows):
        label = f"{path} line {place + 2}"
        try:
            line = _line(row, place, label, lens, half)
            if line.frame in lines and not line.same(lines[line.frame]):
                raise InputError(f"{label} names frame {line.frame} a second time; copy the scan again")
            lines[line.frame] = line
        except InputError as error:
            bad[f"line {place + 2}"] = str(error)
    message = left_out(bad, len(rows), f"lines of {path.name}")
    notes += [message] if message else []
    depths = alike([f"{index:06d}" for index in lines], [n for n in listed(root / "depth") if n.endswith(DEPTHS)])
    photos = alike([f"{index:06d}" for index in lines], files)
    if files and (len(photos) < len(files) or f"{min(lines, default=0):06d}" not in photos):  # FFmpeg counts from 1
        raise InputError(
            f"{root / 'rgb'} has {len(files)} photos, {files[0]} to {files[-1]}, which are not called by the frames' "
            f"numbers in {path.name}, from {min(lines, default=0):06d}; rename them, or put {video.path.name} there"
        )
    shots = []
    for index, line in lines.items():
        stem = f"{index:06d}"
        beyond = not files and 0 < count <= index
        shots.append(
            Shot(
                stem,
                root / "rgb" / photos.get(stem, f"{stem}.jpg"),
                lost(f"{video.path.name} has {count} frames") if beyond else line.pose,
                line.lens,
                None if files else VideoFrame(video, index),
                depth_file(root / "depth" / depths[stem]) if stem in depths else None,
            )
        )
    return Capture(root, "stray", shots, gt_mesh=gt_mesh_in(root), why="ARKit's poses are metres", notes=notes)


def _table(path: Path) -> tuple[list[dict[str, str]], list[str]]:
    """Lines and columns of a table, apart by commas, tabs or semicolons."""
    text = text_of(path).replace("\0", "")
    head = next((line for line in text.splitlines() if line.strip()), "")
    apart = next((letter for letter in ",\t;" if letter in head), ",")
    try:
        table = csv.DictReader(StringIO(text), skipinitialspace=True, delimiter=apart)
        columns = [(name or "").strip() for name in table.fieldnames or []]
        table.fieldnames = columns
        rows = [row for row in table if any(isinstance(value, str) and value.strip() for value in row.values())]
    except csv.Error as error:
        raise InputError(f"{path} is no table ({error}); copy the scan again") from error
    if not rows:
        raise InputError(f"{path} has no columns {', '.join(COLUMNS)}; copy the scan again")
    return rows, [column for column in columns if column]


class _Line(NamedTuple):
    """A frame of the video, its pose and lens."""

    frame: int
    pose: np.ndarray
    lens: Lens

    def same(self, other: _Line) -> bool:
        return bool((self.pose == other.pose).all()) and self.lens == other.lens


def _line(row: dict[str, str], place: int, label: str, lens: Lens, half: bool) -> _Line:
    x, y, z, w = (_value(row, key, label) for key in COLUMNS[3:])
    pose = quaternion_pose(x, y, z, w, [_value(row, key, label) for key in COLUMNS[:3]], label)
    index = int(number(row, "frame", label)) if "frame" in row else place
    if not 0 <= index < 10**8:
        raise InputError(f"{label} names frame {index}; copy the scan again")
    if all((row.get(key) or "").strip() for key in ("fx", "fy", "cx", "cy")):
        fx, fy, cx, cy = (number(row, key, label) for key in ("fx", "fy", "cx", "cy"))
        lens = pinhole_lens(fx, fy, cx, cy, None, label.partition(" line ")[0], half)
    return _Line(index, pose, lens)


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


READER = Reader(is_stray, read_stray, LAYOUT)
