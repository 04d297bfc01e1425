"""TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt with times, photos and depth named by them; or associations.txt.

Poses are camera-to-world of the colour camera with OpenCV axes, interpolated at the photos' times. No file has the
intrinsics: they are those of the folder's freiburg1, 2 or 3, with their distortion; depth is 1/5000 m and has none.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Shot
from room2dgs.captures.depth_maps import DepthMap, depth_file
from room2dgs.captures.left_out import left_out
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import Listing, gt_mesh_in, inside
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import floats, lines_of, quaternion_pose
from room2dgs.captures.trajectories import MAX_APART_S, in_seconds, pose_at_time, written_for
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "rgb.txt, groundtruth.txt and rgb/ (TUM RGB-D)"
SIZE = (640, 480)
# fx fy cx cy (pixel centres at integers), k1 k2 p1 p2 k3
CAMERAS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633),
    "freiburg2": (520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172),
    "freiburg3": (535.4, 539.2, 320.1, 247.6, 0.0, 0.0, 0.0, 0.0, 0.0),
}
DEPTH_UNIT_M = 1 / 5000
# photos with their depth maps, as associate.py writes them: a time and a file, twice
ASSOCIATED = ("associations.txt", "association.txt", "associate.txt", "associated.txt", "associations_rgbd.txt")
PAIR = re.compile(r"(\S+)\s+([-+.\d]+(?:e[-+]?\d+)?)\s+(\S+)", re.IGNORECASE)  # behind the first time


def is_tum(files: Listing) -> bool:
    return "groundtruth.txt" in files and any(name in files for name in ("rgb.txt", *ASSOCIATED))


def read_tum(root: Path, config: SceneConfig) -> Capture:
    """Read a sequence.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    lens = _lens(root, config)
    listed_in, depths_in = _lists(root)
    photos, notes = _stamped(listed_in)
    depths, depth_notes = _depths(root, depths_in)
    stamps, poses, pose_notes = trajectory(root / "groundtruth.txt")
    own = written_for(np.array([stamp for stamp, _ in photos]), stamps)
    depth_stamps = np.array([stamp for stamp, _ in depths])
    shots = []
    for stamp, name in photos:
        depth: DepthMap | None = None
        if depths:
            nearest = int(np.argmin(np.abs(depth_stamps - stamp)))
            if abs(depth_stamps[nearest] - stamp) <= MAX_APART_S:
                depth = depth_file(depths[nearest][1], DEPTH_UNIT_M, distorted=False)
        pose = pose_at_time(stamp, stamps, poses, own=own)
        shots.append(Shot(name, inside(root, name, listed_in), pose, lens, depth=depth))
    return Capture(
        root,
        "tum",
        shots,
        gt_mesh=gt_mesh_in(root),
        why="the motion capture's poses are metres",
        notes=[*notes, *depth_notes, *pose_notes],
    )


def _lists(root: Path) -> tuple[Path, Path]:
    """The lists of the photos and of the depth maps; one that has both stands in for what is missing."""
    both = next((root / name for name in ASSOCIATED if (root / name).is_file()), None)
    photos, depths = root / "rgb.txt", root / "depth.txt"
    if both is None:
        return photos, depths
    return (photos if photos.is_file() else both), (depths if depths.is_file() else both)


def _depths(root: Path, path: Path) -> tuple[list[tuple[float, Path]], list[str]]:
    """Times and files of the depth maps that are there, and notes."""
    if not path.is_file():
        return [], []
    listed, notes = _stamped(path, depth=True)
    files = [(stamp, inside(root, name, path)) for stamp, name in listed]
    there = [(stamp, file) for stamp, file in files if file.is_file()]
    if len(there) < len(files):
        notes.append(f"{path} names {len(files)} depth maps, {len(files) - len(there)} of them are missing")
    return there, notes


def _lens(root: Path, config: SceneConfig) -> Lens | None:
    for name, (fx, fy, cx, cy, *k) in CAMERAS.items():
        if name in root.resolve().name.lower():
            shift = 0.0 if config.pixel_centres == "half" else 0.5
            params = (fx, fy, cx + shift, cy + shift)
            if any(k):
                return Lens("FULL_OPENCV", (*params, *k, 0.0, 0.0, 0.0), SIZE, f"{root} ({name})")
            return Lens("PINHOLE", params, SIZE, f"{root} ({name})")
    return None


def _stamped(path: Path, depth: bool = False) -> tuple[list[tuple[float, str]], list[str]]:
    """(seconds, file) a line, in order of time, white space or a comma between; and notes on lines left out.

    Args:
        depth: the depth map's of a line that has a photo and a depth map; False: the photo's.
    """
    found, bad = [], {}
    lines = lines_of(path)
    for line, text in lines:
        stamp, *rest = re.split(r"[\s,]+", text, maxsplit=1)
        name = "".join(rest)
        pair = PAIR.fullmatch(name.replace(",", " "))
        if pair:
            other = pair[1].lower().startswith("depth") != depth  # some have the depth map first
            stamp, name = (pair[2], pair[3]) if other else (stamp, pair[1])
        try:
            seconds = floats(stamp, path, line, 1)[0]
            if not name or not np.isfinite(seconds):
                raise InputError(f"{path} line {line} has no time and file; copy the sequence again")
        except InputError as error:
            bad[f"line {line}"] = str(error)
            continue
        found.append((seconds, name))
    message = left_out(bad, len(lines), f"lines of {path.name}")
    if not found:
        raise InputError(f"{path} lists no files with times; copy the sequence again")
    stamps, notes = _seconds(np.array([seconds for seconds, _ in found]), path)
    found = [(float(stamp), name) for stamp, (_, name) in zip(stamps, found, strict=True)]
    return sorted(found), [*([message] if message else []), *notes]


def _seconds(stamps: np.ndarray, path: Path) -> tuple[np.ndarray, list[str]]:
    seconds, unit = in_seconds(stamps)
    return seconds, [f"times: those in {path.name} are {unit}, by their size"] if unit else []


def trajectory(path: Path) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times and poses of a text file of lines `time tx ty tz qx qy qz qw`, in order of time.

    Returns:
        (N,) seconds, (N, 4, 4) camera-to-world; poses that are not finite are left out. Notes on lines that are
        damaged.

    Raises:
        InputError: many lines are damaged, or there is none.
    """
    stamps, poses, bad = [], [], {}
    lines = lines_of(path)
    for line, text in lines:
        try:
            stamp, *t, x, y, z, w = floats(text, path, line, 8)
            pose = quaternion_pose(x, y, z, w, t, f"{path} line {line}")
        except InputError as error:
            bad[f"line {line}"] = str(error)
            continue
        if np.isfinite(pose).all() and np.isfinite(stamp):
            stamps.append(stamp)
            poses.append(pose)
    message = left_out(bad, len(lines), f"lines of {path.name}")
    if not poses:
        raise InputError(f"{path} has no poses; copy it again")
    order = np.argsort(stamps, kind="stable")
    seconds, notes = _seconds(np.array(stamps)[order], path)
    return seconds, np.stack(poses)[order], [*([message] if message else []), *notes]


READER = Reader(is_tum, read_tum, LAYOUT)
