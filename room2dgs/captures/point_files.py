"""Point clouds in files: what the user gives, and the cache beside a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from safetensors import SafetensorError
from safetensors.numpy import load_file, save_file

from room2dgs.captures.scene import PointCloud
from room2dgs.errors import InputError
from room2dgs.files import whole_file


def read_ply(path: Path) -> PointCloud:
    """Points of a .ply file, or the vertices of a mesh in one.

    Returns:
        The finite points in metres; grey where the file has no colours; track lengths are 0 (unknown).

    Raises:
        InputError: missing, unreadable or without a finite point.
    """
    if not path.is_file():
        raise InputError(f"{path} is missing; give points.file the path of a .ply with points")
    try:
        geometry = trimesh.load(path, file_type="ply", process=False)
        xyz = np.asarray(geometry.vertices, dtype=np.float64).reshape(-1, 3)
    except Exception as error:  # trimesh raises whatever its parser stumbles over
        raise InputError(f"{path} cannot be read as a .ply file; write the points again") from error
    rgb = _colors(geometry, len(xyz))
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.any():
        raise InputError(f"{path} holds no finite points; give a .ply with points of the scene in metres")
    return PointCloud(xyz[finite], rgb[finite], np.zeros(int(finite.sum()), dtype=np.int32))


def _colors(geometry: trimesh.PointCloud | trimesh.Trimesh, count: int) -> np.ndarray:
    """(count, 3) uint8, grey where the file has none."""
    if isinstance(geometry, trimesh.PointCloud):
        colors = geometry.colors
    else:
        colors = geometry.visual.vertex_colors if geometry.visual.kind == "vertex" else None
    if colors is None or len(colors) != count:
        return np.full((count, 3), 128, dtype=np.uint8)
    return np.asarray(colors, dtype=np.uint8)[:, :3].copy()


def save_points(path: Path, points: PointCloud) -> None:
    """Write a cloud to a safetensors file; nothing half-written is left under its name."""
    with whole_file(path) as temporary:
        save_file({"xyz": points.xyz, "rgb": points.rgb, "track_length": points.track_length}, temporary)


def load_points(path: Path) -> PointCloud | None:
    """A cloud that `save_points` wrote; None if the file is missing or damaged."""
    try:
        tensors = load_file(path)
        points = PointCloud(tensors["xyz"], tensors["rgb"], tensors["track_length"])
    except (OSError, SafetensorError, KeyError):
        return None
    count = len(points)
    expected = {
        "xyz": ((count, 3), np.float64),
        "rgb": ((count, 3), np.uint8),
        "track_length": ((count,), np.int32),
    }
    found = {name: (tensors[name].shape, tensors[name].dtype) for name in expected}
    return points if found == expected else None
