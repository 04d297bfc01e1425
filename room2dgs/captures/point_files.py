"""Point clouds in files: the user's own, and the cache of a run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from room2dgs.captures.ply_elements import Element, read_elements
from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.errors import InputError
from room2dgs.files import whole_file

FRAMES = "frames"  # key of the photos' names in the cache's header


def read_ply(path: Path) -> PointCloud:
    """Points of a .ply file, or the vertices of a mesh in one.

    Returns:
        The finite points in metres; grey where the file has no colours; without tracks.

    Raises:
        InputError: missing, no regular file, unreadable or without a finite point.
    """
    vertex = read_elements(path, ("vertex",), "give points.file the path of a .ply with points").get("vertex")
    if vertex is None or not all(axis in vertex.single for axis in "xyz"):
        raise InputError(f"{path} has no vertices with x, y and z; write the points again")
    xyz = np.stack([vertex.single[axis].astype(np.float64) for axis in "xyz"], axis=1)
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.any():
        raise InputError(f"{path} holds no finite points; give a .ply with points of the scene in metres")
    return PointCloud(xyz[finite], _colors(vertex)[finite])


def _colors(vertex: Element) -> np.ndarray:
    """(count, 3) uint8, grey where the file has none; floats are shares of 1, long integers of their largest."""
    names = ("red", "green", "blue")
    if any(name not in vertex.single for name in names):
        return np.full((len(vertex.single["x"]), 3), 128, dtype=np.uint8)
    channels = [vertex.single[name] for name in names]
    rgb = np.stack(channels, axis=1)
    if rgb.dtype == np.uint8:
        return rgb
    most = 1.0 if rgb.dtype.kind == "f" else float(np.iinfo(rgb.dtype).max)
    return np.round(np.nan_to_num(rgb.astype(np.float64) / most).clip(0, 1) * 255).astype(np.uint8)


def save_points(path: Path, points: PointCloud) -> None:
    """Write a cloud with tracks to a safetensors file; nothing half-written is left under its name."""
    tracks = points.known_tracks
    arrays = {
        "xyz": points.xyz,
        "rgb": points.rgb,
        "track_frame": tracks.frame,
        "track_point": tracks.point,
        "track_pixel": tracks.pixel,
    }
    with whole_file(path) as temporary:
        save_file(arrays, temporary, metadata={FRAMES: json.dumps(tracks.frames)})


def load_points(path: Path) -> PointCloud | None:
    """A cloud that `save_points` wrote; None if the file is missing or damaged, or its points have no tracks."""
    try:
        with safe_open(path, framework="numpy") as file:
            frames = tuple(json.loads(file.metadata()[FRAMES]))
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        tracks = Tracks(frames, arrays["track_frame"], arrays["track_point"], arrays["track_pixel"])
        points = PointCloud(arrays["xyz"], arrays["rgb"], tracks)
    except (OSError, SafetensorError, KeyError, TypeError, ValueError):
        return None
    expected = {
        "xyz": ((len(points), 3), np.float64),
        "rgb": ((len(points), 3), np.uint8),
        "track_frame": ((len(tracks),), np.int32),
        "track_point": ((len(tracks),), np.int32),
        "track_pixel": ((len(tracks), 2), np.float32),
    }
    if {name: (arrays[name].shape, arrays[name].dtype) for name in expected} != expected:
        return None
    counted = _counts(tracks.frame, len(frames)) and _counts(tracks.point, len(points))
    return points if counted else None


def _counts(index: np.ndarray, count: int) -> bool:
    return not len(index) or (index.min() >= 0 and index.max() < count)
