"""Which views go well with a view, from known poses.

There are two questions. Without points: how well do two views triangulate what both may see (`shared_view`)? It picks
pairs for matching (`sfm.pairs`), the neighbours of training views (`neighbours_by_pose`), and the views whose depth is
aligned or optimised together. With points: which few views together triangulate the points of a photo best
(`neighbours_by_points`)? It picks the photos for stereo. Before there are poses, photos are paired by their order and
likeness; that is a third question, see `prepare.pairs`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera

# Of `shared_view`. Depths at which a room's surfaces may be, and a grid of pixels: what two views may both see.
PROBE_DEPTHS_M = (1.0, 2.0, 3.0)
PROBE_GRID = (6, 5)
# Triangulation angles: full use from the first, none beyond the second, where SIFT no longer matches.
USEFUL_ANGLE_DEG = 2.0
LARGEST_ANGLE_DEG = 30.0
MIN_SHARED = 0.1  # views that share less have few pixels to match or to compare
NEAREST_M = 1e-3  # that a probe counts as seen

# Of `neighbours_by_points`.
GRID = (16, 12)  # one point of each cell of the photo is used, so that the whole photo counts alike
FEW_POINTS = 40  # if there are no more, all are used
FULL_ANGLE_DEG = 4.0  # of triangulation: less counts less, by its square
WIDE_ANGLE_DEG = 12.0  # beyond it patches begin to differ
FADE_DEG = 8.0
MIN_AXES_COSINE = 0.75
SAME_PLACE = 0.06  # of the scene's median depth: photos nearer to a chosen one add little
LEAST_BASELINE = 0.02  # of the median depth
TYPICAL_BASELINE = 0.12
NO_POINTS_DEPTH_M = 2.0


def seen_by_others(camera: Camera, others: Sequence[Camera]) -> float:
    """Share of what a camera may see, 1 to 3 m away, that two others at least have in view; nothing is in between."""
    points = _probes(camera)
    views = sum(other.in_view(points).astype(np.int64) for other in others)
    return float(np.mean(views >= 2))


def shared_view(cameras: Sequence[Camera], by_angle: bool = True) -> np.ndarray:
    """How well two views triangulate what both see.

    Points in front of camera i count when j sees them too, weighted by their triangulation angle.

    Args:
        by_angle: false: without these weights; views from one place share what both see.

    Returns:
        (N, N) float64 in 0..1, symmetric (the lesser of both directions), zero diagonal.
    """
    points = np.stack([_probes(camera) for camera in cameras])
    rays = points - np.stack([camera.centre for camera in cameras])[:, None]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    score = np.zeros((len(cameras), len(cameras)))
    for j, camera in enumerate(cameras):
        other = points - camera.centre
        other /= np.linalg.norm(other, axis=-1, keepdims=True).clip(1e-9)
        angle = np.degrees(np.arccos(np.einsum("npc,npc->np", rays, other).clip(-1.0, 1.0)))
        fade = (LARGEST_ANGLE_DEG - angle) / (LARGEST_ANGLE_DEG - USEFUL_ANGLE_DEG)
        weight = np.minimum(angle / USEFUL_ANGLE_DEG, 1.0) * fade.clip(0.0, 1.0) if by_angle else 1.0
        score[:, j] = (weight * camera.in_view(points, NEAREST_M)).mean(axis=1)
    score = np.minimum(score, score.T)
    np.fill_diagonal(score, 0.0)
    return score


def _probes(camera: Camera) -> np.ndarray:
    """(P, 3) points of the world in front of the camera: a grid of pixels at each probe depth."""
    columns, rows = PROBE_GRID
    x, y = np.meshgrid(
        (np.arange(columns) + 0.5) / columns * camera.width, (np.arange(rows) + 0.5) / rows * camera.height
    )
    pixel = np.stack([x.ravel(), y.ravel()], axis=1)
    return np.concatenate([camera.unproject(pixel, np.full(len(pixel), depth)) for depth in PROBE_DEPTHS_M])


def neighbours_by_pose(
    cameras: Sequence[Camera], count: int, min_baseline_m: float, max_baseline_m: float, max_angle_deg: float
) -> list[np.ndarray]:
    """Each view's neighbours, best first by `shared_view`.

    Neighbours look in nearly the same direction, from another place that is not too far away; there may be none, as
    for cameras that only turn.

    Args:
        count: at most so many a view.
        min_baseline_m, max_baseline_m: between the centres, metres.
        max_angle_deg: the angle between the optical axes is smaller.

    Returns:
        one array of indices a camera.
    """
    centres = np.stack([camera.centre for camera in cameras])
    axes = np.stack([camera.forward for camera in cameras])
    baseline = np.linalg.norm(centres[:, None] - centres, axis=-1)
    angle = np.degrees(np.arccos((axes @ axes.T).clip(-1.0, 1.0)))
    score = shared_view(cameras)
    fits = (baseline >= min_baseline_m) & (baseline <= max_baseline_m)
    fits &= (angle < max_angle_deg) & (score >= MIN_SHARED)
    best = np.argsort(np.where(fits, -score, np.inf), axis=1, kind="stable")[:, :count]
    return [row[fits[view, row]] for view, row in enumerate(best)]


def neighbours_by_points(
    cameras: Sequence[Camera], seen: Sequence[np.ndarray], xyz: np.ndarray, count: int
) -> list[np.ndarray]:
    """Up to `count` neighbours of each view, best first, chosen greedily.

    The score of a set of views is the sum over points of sqrt(sum of the views' `triangulation_quality`): a point that
    is triangulated well already gains little from one more view, and a view close to a chosen one counts less. Taking
    the views with the best scores of their own would choose views that all stand on one side.

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
    return [
        _neighbours_of_view(view, camera, centres, axes, sees, seen[view], xyz, count)
        for view, camera in enumerate(cameras)
    ]


def _neighbours_of_view(
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
    quality = np.concatenate(
        [
            triangulation_quality(centres[view], centres[candidates], xyz[points]) * sees[np.ix_(candidates, points)],
            # without common points a view at a usual distance that looks the same way is as good a guess as any
            1e-3
            * (cosine[candidates] - 0.7)[:, None]
            * np.exp(-(((distance[candidates] / depth - TYPICAL_BASELINE) / 0.1) ** 2))[:, None],
        ],
        axis=1,
    )
    so_far, fresh = np.zeros(quality.shape[1]), np.ones(len(candidates))
    chosen: list[int] = []
    for _ in range(min(count, len(candidates))):
        gain = fresh * (np.sqrt(so_far + quality) - np.sqrt(so_far)).sum(axis=1)
        gain[chosen] = -1.0
        best = int(gain.argmax())
        chosen.append(best)
        so_far += quality[best]
        beside = np.linalg.norm(centres[candidates] - centres[candidates[best]], axis=1) / (SAME_PLACE * depth)
        fresh *= 1.0 - 0.8 * np.exp(-(beside**2))
    return candidates[chosen]


def _one_a_cell(pixel: np.ndarray, camera: Camera) -> np.ndarray:
    cell = (pixel / camera.size * GRID).astype(np.int64)
    return np.unique(cell[:, 1] * GRID[0] + cell[:, 0], return_index=True)[1]


def triangulation_quality(centre: np.ndarray, others: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """(C, P) in 0..1: how well each of the other centres triangulates each point with this one."""
    to, to_others = xyz - centre, xyz - others[:, None]
    near, far = np.linalg.norm(to, axis=-1), np.linalg.norm(to_others, axis=-1)
    cosine = (to * to_others).sum(axis=-1) / np.maximum(near * far, 1e-12)
    angle = np.degrees(np.arccos(cosine.clip(-1.0, 1.0)))
    wide = np.exp(-(((angle - WIDE_ANGLE_DEG) / FADE_DEG) ** 2))
    score = np.where(angle < FULL_ANGLE_DEG, (angle / FULL_ANGLE_DEG) ** 2, np.where(angle < WIDE_ANGLE_DEG, 1.0, wide))
    return score * np.minimum(near, far) / np.maximum(np.maximum(near, far), 1e-12)
