"""Places that several photos see: sparse points by their tracks, and surfaces by the photos' depth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from room2dgs.captures.point_cloud import Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps, valid_depth
from room2dgs.exposure.observed import Sights
from room2dgs.geometry.camera import NEAR_M, Camera
from room2dgs.geometry.view_selection import shared_view

COLUMNS = 16  # places across a photo
SAMPLES = 160  # at least, of the depth across a photo; up to twice as many
NEIGHBOURS = 8
MIN_SHARED = 0.1
SAME_DEPTH = 0.03  # relative difference of the depths of one place


def on_tracks(frames: Sequence[Frame], tracks: Tracks) -> list[Sights]:
    """Of each frame: the sparse points that it is known to have seen."""
    seen = (tracks.of_frame(frame.name) for frame in frames)
    return [Sights(place.astype(np.int64), pixel.astype(np.float64)) for place, pixel in seen]


def on_surfaces(frames: Sequence[Frame], maps: Mapping[str, ViewMaps[np.ndarray]], first: int = 0) -> list[Sights]:
    """Of each frame: places on a grid of its own pixels, and of those of its neighbours that its depth agrees with.

    Args:
        maps: depth by frame name; frames without see nothing.
        first: number of the first place.
    """
    depths = {number: depth for number, frame in enumerate(frames) if (depth := _small(maps, frame)) is not None}
    sights: list[list[Sights]] = [[] for _ in frames]
    cameras = {number: frames[number].camera for number in depths}
    for number, others in _neighbours(cameras).items():
        pixel, world = _grid(cameras[number], depths[number])
        place = first + np.arange(len(pixel), dtype=np.int64)
        first += len(pixel)
        sights[number].append(Sights(place, pixel))
        for other in others:
            at, good = _seen_by(cameras[other], depths[other], world)
            sights[other].append(Sights(place[good], at[good]))
    return [together(parts) for parts in sights]


def together(parts: Sequence[Sights]) -> Sights:
    """What one photo sees, of several kinds."""
    if not parts:
        return Sights(np.zeros(0, np.int64), np.zeros((0, 2)))
    return Sights(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _small(maps: Mapping[str, ViewMaps[np.ndarray]], frame: Frame) -> np.ndarray | None:
    """Every n-th sample of a frame's depth, so that many of them may be held."""
    depth = maps[frame.name].depth if frame.name in maps else None
    if depth is None:
        return None
    step = max(1, depth.shape[1] // SAMPLES)
    return depth[step // 2 :: step, step // 2 :: step].copy()


def _neighbours(cameras: Mapping[int, Camera]) -> dict[int, list[int]]:
    """Of each view, those that share most with it; a view from the same place is as good."""
    if not cameras:
        return {}
    numbers = list(cameras)
    shared = shared_view(list(cameras.values()), by_angle=False)
    best = np.argsort(-shared, axis=1, kind="stable")[:, :NEIGHBOURS]
    return {
        numbers[view]: [numbers[other] for other in row if shared[view, other] >= MIN_SHARED]
        for view, row in enumerate(best)
    }


def _grid(camera: Camera, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) pixels that have a depth, evenly over the photo, and (N, 3) what they show, world."""
    step = max(1, camera.width // COLUMNS)
    x, y = np.meshgrid(np.arange(step / 2, camera.width, step), np.arange(step / 2, camera.height, step))
    pixel = np.stack([x.ravel(), y.ravel()], axis=1)
    z = _at(depth, camera, pixel)
    known = valid_depth(z)
    return pixel[known], camera.unproject(pixel[known], z[known].astype(np.float64))


def _seen_by(camera: Camera, depth: np.ndarray, world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) pixels of points, and (N,) whether the camera sees them there."""
    pixel, z = camera.project(world)
    good = camera.inside(pixel) & (z > NEAR_M)
    found = np.zeros(len(world))
    found[good] = _at(depth, camera, pixel[good])
    return pixel, good & valid_depth(found) & (np.abs(found - z) < SAME_DEPTH * z)


def _at(depth: np.ndarray, camera: Camera, pixel: np.ndarray) -> np.ndarray:
    """(N,) depth at the nearest sample of a map of any size."""
    size = np.array(depth.shape[1::-1])
    column, row = np.clip(np.floor(pixel * size / camera.size).astype(int), 0, size - 1).T
    return depth[row, column]
