"""A corner of two textured planes, seen by a few cameras, with exact depth."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.geometry.camera import Camera

WIDTH, HEIGHT, FOCAL = 96, 72, 90.0


def make_camera(x: float, y: float, turn: float) -> Camera:
    """Looks along z, turned about the vertical axis; the principal point is off the middle."""
    rotation = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = -rotation @ [x, y, 0.0]
    K = np.array([[FOCAL, 0, WIDTH / 2 + 3.0], [0, 1.05 * FOCAL, HEIGHT / 2 - 2.0], [0, 0, 1]])
    return Camera(K, WIDTH, HEIGHT, pose)


def texture(seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=(600, 600)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 3.0)
    return np.clip(128 + 110 * smooth / np.abs(smooth).max(), 0, 255)


# n . X = d in the world; a wall that recedes to the right and a floor
PLANES = [(np.array([-0.3, 0.0, 1.0]), 2.0), (np.array([0.0, 1.0, 0.0]), 0.55)]


def rendered(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(H, W) uint8 photo, (H, W) exact z-depth, (H, W, 3) exact normals in the camera's frame, facing it."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(camera.K).T
    world = rays @ camera.cam_from_world[:3, :3]
    grey, depth = np.zeros((HEIGHT, WIDTH), np.float32), np.full((HEIGHT, WIDTH), np.inf)
    normals = np.zeros((HEIGHT, WIDTH, 3))
    for index, (normal, d) in enumerate(PLANES):
        slope = world @ normal
        with np.errstate(divide="ignore"):
            z = np.where(slope > 1e-6, (d - camera.centre @ normal) / slope, np.inf)
        nearer = z < depth
        point = camera.centre + world * np.where(np.isfinite(z), z, 0)[..., None]
        across = point[..., 0] if index == 0 else point[..., 2]
        along = point[..., 1] if index == 0 else point[..., 0]
        maps = ((part * 90 + 300).astype(np.float32) for part in (across, along))
        light = cv2.remap(texture(index), *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        grey, depth = np.where(nearer, light, grey), np.where(nearer, z, depth)
        facing = -camera.cam_from_world[:3, :3] @ (normal / np.linalg.norm(normal))
        normals[nearer] = facing
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8), depth, normals


@pytest.fixture(scope="session")
def corner() -> list[tuple[Camera, np.ndarray, np.ndarray, np.ndarray]]:
    """Camera, photo, depth and normals of five views 15 cm apart."""
    places = [(0.0, 0.0, 0.0), (0.15, 0.0, 0.03), (-0.15, 0.02, -0.03), (0.02, -0.15, 0.0), (0.3, 0.05, 0.08)]
    cameras = [make_camera(*place) for place in places]
    return [(camera, *rendered(camera)) for camera in cameras]
