"""A box room with textured walls and a rectangle in one of them, as views would measure it: exact, by ray casting."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from room2dgs.geometry.camera import Camera
from room2dgs.mirrors.sights import SmallView

ROOM = np.array([4.0, 3.2, 2.5])  # metres, from the origin; the rectangle is in the wall y = 0
LOW, HIGH = np.array([1.2, 0.9]), np.array([2.6, 2.0])  # its corners, x and z
BEHIND = np.array([3.0, 4.0, 2.5])  # metres of the room behind an opening
SIDE_M = 2.0
TEXEL_M, TEXELS = 0.04, 80
SMALL = 160, 120


def room_views(rectangle: str) -> list[SmallView]:
    """Ten views that look at the wall with the rectangle and eight that look away from it.

    Args:
        rectangle: "mirror"; "wall"; "opening" to another room; "twin", an opening to a room of the mirror image's shape
            in other colours; "shallow", one to the mirror image with a
            nearer back wall at one side; or "symmetric" (the whole wall
            is open to the mirror image: there is no wall).
    """
    share = np.linspace(0, 1, 10)
    eyes = np.column_stack([0.7 + 2.6 * share, 2.2 - 0.6 * np.sin(3 * share), 1.3 + 0.2 * np.cos(5 * share)])
    looks = [(eye, np.array([1.4 + share, 0.0, 1.4])) for eye, share in zip(eyes, share, strict=True)]
    for angle in np.linspace(0.1 * np.pi, 0.9 * np.pi, 8):
        eye = np.array([2.0 - 0.6 * np.cos(angle), 0.9, 1.4])
        looks.append((eye, eye + np.array([np.cos(angle), np.sin(angle), -0.1])))
    return [_view(eye, target, rectangle) for eye, target in looks]


def moved(views: list[SmallView], world_from_room: np.ndarray) -> list[SmallView]:
    """The same views in another world, by a rigid (4, 4)."""
    back = np.linalg.inv(world_from_room)
    return [replace(one, camera=replace(one.camera, cam_from_world=one.camera.cam_from_world @ back)) for one in views]


def looking(eye: np.ndarray, target: np.ndarray, size: tuple[int, int]) -> Camera:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    cam_from_world = np.eye(4)
    cam_from_world[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    cam_from_world[:3, 3] = -cam_from_world[:3, :3] @ eye
    width, height = size
    focal = 0.75 * width
    return Camera(np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]]), width, height, cam_from_world)


def _view(eye: np.ndarray, target: np.ndarray, rectangle: str) -> SmallView:
    small = looking(eye, target, SMALL)
    depth, color = _seen(small, rectangle)
    lab = cv2.cvtColor(color, cv2.COLOR_RGB2LAB).astype(np.float64)
    counts = np.full(depth.shape, 5, np.uint8)
    return SmallView(small, depth, counts, lab)


def _seen(camera: Camera, rectangle: str) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) z-depth as stereo has it, behind the glass of a mirror; (H, W, 3) uint8."""
    ray = camera.world_rays()
    start = np.broadcast_to(camera.centre, ray.shape)
    depth = _leaves(start, ray, np.zeros(3), ROOM)
    place = start + ray * depth[..., None]
    color = _texture(place, 0)
    at = place[..., [0, 2]]
    through = (place[..., 1] < 1e-9) & ((at > LOW) & (at < HIGH)).all(axis=-1)
    if rectangle == "symmetric":
        through = place[..., 1] < 1e-9
    if rectangle == "wall":
        return depth, color
    if rectangle == "opening":
        low = np.array([0.3, -BEHIND[1], 0.0])
        more = _leaves(place, ray, low, low + BEHIND)
        seen = _texture(place + ray * more[..., None], 1)
    else:
        flipped = ray * [1, -1, 1]
        more = _leaves(place, flipped, np.zeros(3), ROOM)
        if rectangle == "shallow":
            near = _leaves(place, flipped, np.zeros(3), ROOM * [1, 0.7, 1])
            more = np.where((place + flipped * near[..., None])[..., 0] > SIDE_M, near, more)
        seen = _texture(place + flipped * more[..., None], 1 if rectangle == "twin" else 0)
    return np.where(through, depth + more, depth), np.where(through[..., None], seen, color)


def _leaves(start: np.ndarray, ray: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """How far along rays from inside a box they leave it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(ray > 0, (high - start) / ray, np.where(ray < 0, (low - start) / ray, np.inf))
    return far.min(axis=-1)


def _texture(place: np.ndarray, number: int) -> np.ndarray:
    """(..., 3) uint8 colours of places (..., 3), smooth and random."""
    at = np.mod(place / TEXEL_M, TEXELS).reshape(-1, 3).T
    channels = [map_coordinates(one, at, order=1, mode="grid-wrap") for one in _noise(number)]
    return np.stack(channels, axis=-1).reshape(place.shape).astype(np.uint8)


@cache
def _noise(number: int) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(number)
    found = []
    for _ in range(3):
        fine = random.random((TEXELS, TEXELS, TEXELS), np.float32)
        smooth = gaussian_filter(fine, 1.0, mode="wrap")
        found.append(np.clip(128 + 90 * (smooth - smooth.mean()) / smooth.std(), 5, 250).astype(np.float32))
    return tuple(found)
