"""A capture in ScanNet's layout that the tests draw themselves: a textured corner of a room.

Three planes x = 0, y = 0, z = 0 meet in the origin (z up); cameras look into the corner from 2 m away.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.config import Config, PointsConfig, load_config

WIDTH, HEIGHT, FOCAL = 320, 240, 260.0
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


def disk_intrinsics(width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """(3, 3) K that counts pixel centres at integers, as ScanNet does."""
    scale = width / WIDTH
    return np.array([[FOCAL * scale, 0, (width - 1) / 2], [0, FOCAL * scale, (height - 1) / 2], [0, 0, 1.0]])


def draw_corner(world_from_cam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((H, W, 3) uint8 photo, (H, W) uint16 z-depth in mm) by casting a ray through every pixel's centre."""
    K = disk_intrinsics()
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = np.stack([(x - K[0, 2]) / FOCAL, (y - K[1, 2]) / FOCAL, np.ones_like(x, float)], axis=-1)
    rays = rays @ world_from_cam[:3, :3].T
    eye = world_from_cam[:3, 3]
    depths = np.where(rays < -1e-6, -eye / np.minimum(rays, -1e-6), np.inf)
    plane = depths.argmin(axis=-1)
    depth = depths.min(axis=-1)
    points = eye + depth[..., None] * rays
    photo = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
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
