"""Which photos to match with which, from their known poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera

# Where the surfaces of a room may be: depths at which two views are asked how much they share.
PROBE_DEPTHS_M = (1.0, 2.0, 3.0)
PROBE_GRID = (6, 5)
# Triangulation angles: full use from the first, none beyond the second, where SIFT no longer matches.
USEFUL_ANGLE_DEG = 2.0
LARGEST_ANGLE_DEG = 30.0
LEAST_SHARED = 0.1
# Two views from one place triangulate nothing.
MIN_BASELINE_M = 1e-3
NEAREST_M = 1e-3  # that a probe counts as seen


def match_pairs(cameras: Sequence[Camera], overlap: int) -> list[tuple[int, int]]:
    """Pairs worth matching: half of `overlap` successors in capture order, and half chosen by pose.

    Successors carry tracks along the path; the ones chosen by pose give parallax and close loops.

    Returns:
        Sorted index pairs (i, j), i < j, each once and with a baseline; at most `overlap` times N of them.
    """
    count = len(cameras)
    half = (overlap + 1) // 2
    pairs = {(i, j) for i in range(count) for j in range(i + 1, min(i + half + 1, count))}
    score = shared_view(cameras)
    for i in range(count):
        best = np.argsort(-score[i], kind="stable")[: overlap - half]
        pairs |= {(min(i, int(j)), max(i, int(j))) for j in best if score[i, j] > LEAST_SHARED}
    centres = np.stack([camera.centre for camera in cameras])
    return [(i, j) for i, j in sorted(pairs) if np.linalg.norm(centres[i] - centres[j]) > MIN_BASELINE_M]


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
