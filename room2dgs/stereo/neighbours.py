"""Which photos a photo is compared with: they see the same points, from useful angles, from different sides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera

GRID = (16, 12)  # one point a cell of the photo has a say, so that the whole photo counts alike
FEW_POINTS = 40  # all of fewer have a say
FULL_ANGLE_DEG = 4.0  # of triangulation: less counts less, by its square
WIDE_ANGLE_DEG = 12.0  # beyond it patches begin to differ
FADE_DEG = 8.0
MIN_AXES_COSINE = 0.75
SAME_PLACE = 0.06  # of the scene's median depth: photos nearer to one that is taken add little
LEAST_BASELINE = 0.02  # of the median depth
TYPICAL_BASELINE = 0.12
NO_POINTS_DEPTH_M = 2.0


def choose_neighbours(
    cameras: Sequence[Camera], seen: Sequence[np.ndarray], xyz: np.ndarray, count: int
) -> list[np.ndarray]:
    """Up to `count` neighbours of each view, best first, chosen greedily.

    A view's score is the sum over points of sqrt(use by the views that are taken): a point that has its good angle
    already gains little from one more, and a view beside one that is taken counts less. Best scores alone choose
    views that all stand on one side.

    Args:
        cameras: V views.
        seen: V arrays of point indices that each view sees.
        xyz: (M, 3) points, metres.
        count: of neighbours.

    Returns:
        V arrays of view indices; fewer than `count` where fewer views look at the same place.
    """
    centres = np.stack([camera.centre for camera in cameras])
    axes = np.stack([camera.forward for camera in cameras])
    sees = np.zeros((len(cameras), len(xyz)), dtype=bool)
    for view, points in enumerate(seen):
        sees[view, points] = True
    return [_of_view(view, cameras[view], centres, axes, sees, seen[view], xyz, count) for view in range(len(cameras))]


def _of_view(
    view: int,
    camera: Camera,
    centres: np.ndarray,
    axes: np.ndarray,
    sees: np.ndarray,
    points: np.ndarray,
    xyz: np.ndarray,
    count: int,
) -> np.ndarray:
    pixel, z = camera.project(xyz[points])
    depth = float(np.median(z)) if len(points) else NO_POINTS_DEPTH_M
    points = points[_one_a_cell(pixel, camera)] if len(points) > FEW_POINTS else points
    distance = np.linalg.norm(centres - centres[view], axis=1)
    cosine = axes @ axes[view]
    candidates = np.flatnonzero((cosine > MIN_AXES_COSINE) & (distance > LEAST_BASELINE * depth) & (distance < depth))
    candidates = candidates[candidates != view]
    if not len(candidates):
        return candidates
    use = np.concatenate(
        [
            _use(centres[view], centres[candidates], xyz[points]) * sees[np.ix_(candidates, points)],
            # without common points a view at a usual distance that looks the same way is as good a guess as any
            1e-3
            * (cosine[candidates] - 0.7)[:, None]
            * np.exp(-(((distance[candidates] / depth - TYPICAL_BASELINE) / 0.1) ** 2))[:, None],
        ],
        axis=1,
    )
    had, fresh = np.zeros(use.shape[1]), np.ones(len(candidates))
    taken: list[int] = []
    for _ in range(min(count, len(candidates))):
        gain = fresh * (np.sqrt(had + use) - np.sqrt(had)).sum(axis=1)
        gain[taken] = -1.0
        best = int(gain.argmax())
        taken.append(best)
        had += use[best]
        beside = np.linalg.norm(centres[candidates] - centres[candidates[best]], axis=1) / (SAME_PLACE * depth)
        fresh *= 1.0 - 0.8 * np.exp(-(beside**2))
    return candidates[taken]


def _one_a_cell(pixel: np.ndarray, camera: Camera) -> np.ndarray:
    cell = (pixel / camera.size * GRID).astype(np.int64)
    return np.unique(cell[:, 1] * GRID[0] + cell[:, 0], return_index=True)[1]


def _use(centre: np.ndarray, others: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """(C, P) in 0..1: how well each of the other centres triangulates each point with this one."""
    to, to_others = xyz - centre, xyz - others[:, None]
    near, far = np.linalg.norm(to, axis=-1), np.linalg.norm(to_others, axis=-1)
    cosine = (to * to_others).sum(axis=-1) / np.maximum(near * far, 1e-12)
    angle = np.degrees(np.arccos(cosine.clip(-1.0, 1.0)))
    wide = np.exp(-(((angle - WIDE_ANGLE_DEG) / FADE_DEG) ** 2))
    score = np.where(angle < FULL_ANGLE_DEG, (angle / FULL_ANGLE_DEG) ** 2, np.where(angle < WIDE_ANGLE_DEG, 1.0, wide))
    return score * np.minimum(near, far) / np.maximum(np.maximum(near, far), 1e-12)
