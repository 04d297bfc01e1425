"""Shared by all tests."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

# Parallel workers share the cores. With a thread each for every core, OpenMP's would wait for one another, spinning.
# Before torch is imported: that is when it reads them.
if workers := int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "0")):
    share = max(1, (os.cpu_count() or 1) // workers)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, str(share))

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import settings

from room2dgs import cuda_state
from room2dgs.config import Config, PointsConfig, load_config
from room2dgs.eval.protocol import MeshFile, Options
from room2dgs.geometry.camera import Camera
from room2dgs.logs import LOGGER

# No test fails for a slow machine. CI must not turn red by the luck of the draw; at home hypothesis goes on searching
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("home", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "home")

WIDTH, HEIGHT, FOCAL = 64, 48, 50.0
WALL_Z = 2.0


@pytest.fixture
def without_gpu(monkeypatch):
    """As on a machine that has none."""
    monkeypatch.setattr(cuda_state, "missing", lambda: ["an NVIDIA driver"])


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """`installed(name, text, points)` installs a package of one module for a test, with these entry points."""

    def install(name: str, text: str, points: str) -> None:
        site = tmp_path / "installed" / name
        site.mkdir(parents=True)
        (site / f"{name}.py").write_text(text)
        info = site / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(points)
        monkeypatch.delitem(sys.modules, name, raising=False)
        monkeypatch.syspath_prepend(str(site))

    return install


@pytest.fixture
def logged_warnings(monkeypatch, caplog):
    """What modules warn of, whatever runs were logged before in this process."""
    monkeypatch.setattr(LOGGER, "handlers", [caplog.handler])
    monkeypatch.setattr(LOGGER, "propagate", False)
    return caplog


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


def rotation(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.fixture
def camera() -> Camera:
    """fx != fy, the principal point off the centre, a turned and shifted pose; 45 x 38 pixels."""
    pose = np.eye(4)
    pose[:3, :3] = rotation([0.3, 1.0, -0.5], 2.1)
    pose[:3, 3] = [0.7, -1.3, 0.4]
    return Camera(np.array([[40.0, 0, 20.3], [0, 47.0, 21.1], [0, 0, 1]]), 45, 38, pose)


CORNER_WIDTH, CORNER_HEIGHT, CORNER_FOCAL = 320, 240, 260.0
CAPTURE_FRAMES = 8
TEXELS_PER_M = 200
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 97, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x111111]  # full-size chroma


def look_at(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(4, 4) world_from_cam with OpenCV axes, z of the world up."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    return pose


def disk_intrinsics(width: int = CORNER_WIDTH, height: int = CORNER_HEIGHT) -> np.ndarray:
    """(3, 3) K that counts pixel centres at integers, as ScanNet does."""
    scale = width / CORNER_WIDTH
    return np.array(
        [[CORNER_FOCAL * scale, 0, (width - 1) / 2], [0, CORNER_FOCAL * scale, (height - 1) / 2], [0, 0, 1.0]]
    )


def draw_corner(world_from_cam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((H, W, 3) uint8 photo, (H, W) uint16 z-depth in mm) by casting a ray through every pixel's centre."""
    K = disk_intrinsics()
    x, y = np.meshgrid(np.arange(CORNER_WIDTH), np.arange(CORNER_HEIGHT))
    rays = np.stack([(x - K[0, 2]) / CORNER_FOCAL, (y - K[1, 2]) / CORNER_FOCAL, np.ones_like(x, float)], axis=-1)
    rays = rays @ world_from_cam[:3, :3].T
    eye = world_from_cam[:3, 3]
    depths = np.where(rays < -1e-6, -eye / np.minimum(rays, -1e-6), np.inf)
    plane = depths.argmin(axis=-1)
    depth = depths.min(axis=-1)
    points = eye + depth[..., None] * rays
    photo = np.zeros((CORNER_HEIGHT, CORNER_WIDTH, 3), np.uint8)
    for axis in range(3):
        texture = _texture(axis)
        u, v = (points[..., other].astype(np.float32) * TEXELS_PER_M for other in range(3) if other != axis)
        drawn = cv2.remap(texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        photo[plane == axis] = drawn[plane == axis]
    return photo, (depth * 1000.0).round().clip(0, 65535).astype(np.uint16)


@lru_cache
def _texture(seed: int) -> np.ndarray:
    """(1000, 1000, 3) smooth noise with detail at several sizes."""
    noise = np.random.default_rng(seed).normal(size=(1000, 1000, 3))
    mixed = sum(cv2.GaussianBlur(noise, (0, 0), sigma) * sigma for sigma in (2.0, 5.0, 12.0))
    return (128 + 45 * mixed / mixed.std()).clip(0, 255).astype(np.uint8)


def write_matrix(path: Path, matrix: np.ndarray) -> None:
    np.savetxt(path, matrix, fmt="%.9f")


@pytest.fixture(scope="session")
def corner_views() -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(world_from_cam, photo, depth) of every frame, along an arc around the corner."""
    views = []
    for angle in np.radians(np.linspace(25.0, 65.0, CAPTURE_FRAMES)):
        # as a hand does it: neither the radius nor the height stays the same
        radius, height = 2.2 + 0.2 * np.sin(9.0 * angle), 1.3 + 0.15 * np.cos(13.0 * angle)
        eye = np.array([radius * np.cos(angle), radius * np.sin(angle), height])
        pose = look_at(eye, np.array([0.2, 0.2, 0.4]))
        views.append((pose, *draw_corner(pose)))
    return views


@pytest.fixture(scope="session")
def corner_walk():
    """`corner_walk(eyes, targets)` gives (world_from_cam, photo) of cameras that look at the corner."""

    def walk(eyes, targets) -> list[tuple[np.ndarray, np.ndarray]]:
        poses = [look_at(np.array(eye), np.array(target)) for eye, target in zip(eyes, targets, strict=True)]
        return [(pose, draw_corner(pose)[0]) for pose in poses]

    return walk


@pytest.fixture
def capture(tmp_path: Path, corner_views) -> Path:
    """The capture's folder: frames 0, 5, 10, ... so that numerical and alphabetical order differ."""
    root = tmp_path / "capture"
    for folder in ("color", "depth", "pose", "intrinsic"):
        (root / folder).mkdir(parents=True)
    K = np.eye(4)
    K[:3, :3] = disk_intrinsics()
    write_matrix(root / "intrinsic" / "intrinsic_color.txt", K)
    write_matrix(root / "intrinsic" / "intrinsic_depth.txt", K)
    for i, (pose, photo, depth) in enumerate(corner_views):
        cv2.imwrite(str(root / "color" / f"{5 * i}.jpg"), photo, JPEG)
        cv2.imwrite(str(root / "depth" / f"{5 * i}.png"), depth)
        write_matrix(root / "pose" / f"{5 * i}.txt", pose)
    return root


@pytest.fixture(scope="session")
def default_config() -> Config:
    return load_config(["scene.path=unused", "out=unused", "scene.test_every=4"])


@pytest.fixture
def scene_config(capture: Path, default_config: Config):
    """`scene_config(**changes)` gives the default SceneConfig of the capture with some fields changed."""
    return lambda **changes: replace(default_config.scene, **{"path": str(capture), **changes})


@pytest.fixture
def points_config(default_config: Config) -> PointsConfig:
    return replace(default_config.points, max_features=1000)


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


def options(**changes) -> Options:
    return Options(**{"samples": 40_000, **changes})


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
        options=options,
        file=MeshFile,
    )
