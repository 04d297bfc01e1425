"""Rooms and cameras whose scores are known by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from room2dgs.config import EvalConfig
from room2dgs.eval.protocol import MeshFile
from room2dgs.geometry.camera import Camera

SIZE = (4.0, 3.0, 2.5)  # the room, metres; it stands about the origin, z up


def quad(corner, first, second, cells=1) -> trimesh.Trimesh:
    """A rectangle corner + a first + b second, cut into cells x cells x 2 triangles (or (n, m) cells)."""
    n, m = (cells, cells) if isinstance(cells, int) else cells
    a, b = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    vertices = np.array(corner) + a.reshape(-1, 1) * np.array(first) + b.reshape(-1, 1) * np.array(second)
    index = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    p, q, r, s = (block.ravel() for block in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    return trimesh.Trimesh(vertices, faces, process=False)


def walls(size=SIZE, spacing=None) -> dict[str, trimesh.Trimesh]:
    """The six sides of a room; `spacing` is the edge of their triangles (None: two triangles a side)."""
    sides = {}
    for axis, (low, high) in enumerate([("west", "east"), ("south", "north"), ("floor", "ceiling")]):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        first, second = np.zeros(3), np.zeros(3)
        first[u], second[v] = size[u], size[v]
        cells = 1 if spacing is None else (round(size[u] / spacing), round(size[v] / spacing))
        for name, sign in ((low, -1), (high, 1)):
            corner = -np.array(size) / 2
            corner[axis] *= -sign
            sides[name] = quad(corner, first, second, cells)
    return sides


def room(size=SIZE, spacing=None, without=()) -> trimesh.Trimesh:
    return join(*(side for name, side in walls(size, spacing).items() if name not in without))


def join(*meshes) -> trimesh.Trimesh:
    return trimesh.util.concatenate(list(meshes))


def moved(mesh, *shift) -> trimesh.Trimesh:
    copy = mesh.copy()
    copy.apply_translation(shift)
    return copy


def camera_at(centre, forward, pixels=160, half_angle_deg=48.0) -> Camera:
    """A square image; y down is -z of the world, unless the camera looks along z."""
    forward = np.asarray(forward, dtype=float)
    down = np.array([0, 0, -1.0]) if abs(forward[2]) < 0.9 else np.array([0, 1.0, 0])
    right = np.cross(down, forward)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = -rotation @ np.asarray(centre, dtype=float)
    focal = pixels / 2 / np.tan(np.radians(half_angle_deg))
    K = np.array([[focal, 0, pixels / 2], [0, focal, pixels / 2], [0, 0, 1]])
    return Camera(K, pixels, pixels, pose)


def all_around(centre=(0.0, 0.0, 0.0)) -> list[Camera]:
    """Six cameras that together see every direction."""
    return [camera_at(centre, sign * np.eye(3)[axis]) for axis in range(3) for sign in (-1, 1)]


def config(**changes) -> EvalConfig:
    values = {
        "protocols": ["area"],
        "threshold_m": 0.05,
        "samples": 40_000,
        "seed": 0,
        "image_metrics": False,
    }
    return EvalConfig(**{**values, **changes})


@pytest.fixture
def make():
    """The helpers above, for test modules (which cannot import a conftest)."""
    return SimpleNamespace(
        SIZE=SIZE,
        quad=quad,
        walls=walls,
        room=room,
        join=join,
        moved=moved,
        camera_at=camera_at,
        all_around=all_around,
        config=config,
        file=MeshFile,
    )
