"""Shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import settings

# CI must not turn red by the luck of the draw; at home hypothesis goes on searching
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")

WIDTH, HEIGHT, FOCAL = 64, 48, 50.0
WALL_Z = 2.0


@pytest.fixture(scope="session")
def wall(tmp_path_factory) -> Path:
    return write_wall(tmp_path_factory.mktemp("capture") / "wall")


def write_wall(folder: Path, views: int = 8) -> Path:
    """A capture of a patterned wall at z = 2 m, seen from a row of cameras; its points and exact mesh with it."""
    for name in ("color", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    K = np.eye(4)
    K[0, 0] = K[1, 1] = FOCAL
    K[0, 2], K[1, 2] = WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", K)
    for view in range(views):
        world_from_cam = np.eye(4)
        world_from_cam[0, 3] = 0.1 * view
        np.savetxt(folder / f"pose/{view}.txt", world_from_cam)
        x = (np.arange(WIDTH) - K[0, 2]) / FOCAL * WALL_Z + 0.1 * view
        y = (np.arange(HEIGHT) - K[1, 2]) / FOCAL * WALL_Z
        light = 127 + 90 * np.sin(5 * x)[None] * np.cos(4 * y)[:, None]
        photo = np.stack([light, 255 - light, np.full_like(light, 90)], axis=-1)
        cv2.imwrite(str(folder / f"color/{view}.png"), photo.astype(np.uint8))
    x, y = np.meshgrid(np.arange(-1.3, 2.0, 0.1), np.arange(-1.0, 1.01, 0.1))
    grid = np.stack([x.ravel(), y.ravel(), np.full(x.size, WALL_Z)], axis=1)
    trimesh.PointCloud(grid, colors=np.full((len(grid), 3), 128, np.uint8)).export(folder / "points.ply")
    rows, columns = x.shape
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([corner, corner + columns, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + columns, corner + columns + 1], axis=1)
    trimesh.Trimesh(grid, np.concatenate([lower, upper]), process=False).export(folder / "gt_mesh.ply")
    return folder
