"""The cost of planes in plain numpy and float64: the oracle of the compiled kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.stereo.patchmatch import Matching, warp

# The kernels' own limits, see stereo/csrc.
WORST = 2.0
NEAREST = 1e-4
AREAS = (0.15, 6.0)
EDGE_PX = 2.0
WINDOW_REACH_PX = 18.0
MAX_REPROJECTION_PX = 3.0


def plane_costs(
    view: tuple[np.ndarray, Camera],
    others: Sequence[tuple[np.ndarray, Camera]],
    planes: np.ndarray,
    settings: Matching,
    inverse_depths: Sequence[np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Cost of a plane at each pixel of a photo, and the variance of the pixel's window.

    The cost in one view is 1 - NCC of the window and its image under the plane's affine warp, both weighted by
    grey level and distance (bilateral), with a floor under both variances; `WORST` where the view does not see the
    window or sees it too foreshortened. Of the views the `settings.top_k` smallest costs are averaged.

    Args:
        view: grey photo (H, W) uint8 and its camera.
        others: likewise, of the neighbours.
        planes: (3, H, W) inverse depth at the pixel and its gradient over the image.
        inverse_depths: (h, w) of each neighbour, 0 = unknown: adds `settings.geometric_weight` x the forward-backward
            reprojection error; None: without.

    Returns:
        (H, W) costs and (H, W) variances, float64.
    """
    grey, camera = view
    height, width = grey.shape
    y, x = np.mgrid[:height, :width].astype(np.float64)
    reach = settings.radius // settings.step * settings.step
    steps = np.arange(-reach, reach + 1, settings.step)
    offsets = [(int(dx), int(dy)) for dy in steps for dx in steps]
    middle = grey.astype(np.float64)
    windows, weights = [], []
    for dx, dy in offsets:
        rows, columns = np.clip(y + dy, 0, height - 1).astype(int), np.clip(x + dx, 0, width - 1).astype(int)
        difference = grey[rows, columns] - middle
        exponent = (difference / settings.sigma_grey) ** 2 + (dx * dx + dy * dy) / settings.sigma_px**2
        windows.append(difference)
        weights.append(np.exp(np.maximum(-exponent / 2, -24 * np.log(2))))
    window, weight = np.stack(windows), np.stack(weights)
    weight /= weight.sum(axis=0)
    mean = (weight * window).sum(axis=0)
    variance = np.maximum((weight * window**2).sum(axis=0) - mean**2, 0)
    geometric = settings.geometric_weight if inverse_depths is not None else 0.0
    worst = WORST + geometric * MAX_REPROJECTION_PX
    costs = []
    for index, (photo, other) in enumerate(others):
        seen, (u, v), (ux, uy, vx, vy) = _warped(camera, other, x, y, planes)
        reaches = np.maximum(abs(ux) + abs(uy), abs(vx) + abs(vy)) * reach
        seen &= (u >= EDGE_PX) & (u <= other.width - 1 - EDGE_PX) & (v >= EDGE_PX) & (v <= other.height - 1 - EDGE_PX)
        seen &= reaches < WINDOW_REACH_PX
        u, v = np.where(seen, u, 0), np.where(seen, v, 0)
        samples = np.stack([_bilinear(photo, u + ux * dx + uy * dy, v + vx * dx + vy * dy) for dx, dy in offsets])
        first = (weight * samples).sum(axis=0)
        other_variance = np.maximum((weight * (samples - first) ** 2).sum(axis=0), 0)
        product = (weight * (window - mean) * samples).sum(axis=0)
        floor = settings.variance_floor
        cost = np.clip(1 - product / np.sqrt((variance + floor) * (other_variance + floor)), 0, WORST)
        if inverse_depths is not None:
            cost += geometric * _round_trip(camera, other, x, y, u, v, inverse_depths[index])
        costs.append(np.where(seen, cost, worst))
    best = np.sort(np.stack(costs), axis=0)[: min(settings.top_k, len(others))]
    return best.mean(axis=0), variance


def _warped(camera: Camera, other: Camera, x: np.ndarray, y: np.ndarray, planes: np.ndarray):
    w, gx, gy = planes.astype(np.float64)
    matrix = warp(camera, other)
    p, q, z = (row[0] * x + row[1] * y + row[2] + row[3] * w for row in matrix)
    inverse = 1 / np.maximum(z, NEAREST)
    u, v = p * inverse, q * inverse
    zx, zy = matrix[2, 0] + matrix[2, 3] * gx, matrix[2, 1] + matrix[2, 3] * gy
    ux, uy = ((matrix[0, k] + matrix[0, 3] * g - u * dz) * inverse for k, g, dz in ((0, gx, zx), (1, gy, zy)))
    vx, vy = ((matrix[1, k] + matrix[1, 3] * g - v * dz) * inverse for k, g, dz in ((0, gx, zx), (1, gy, zy)))
    area = ux * vy - uy * vx
    return (z > NEAREST) & (area > AREAS[0]) & (area < AREAS[1]), (u, v), (ux, uy, vx, vy)


def _bilinear(photo: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    height, width = photo.shape
    left, top = np.floor(u), np.floor(v)
    s, t = u - left, v - top

    def at(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return photo[np.clip(row, 0, height - 1).astype(int), np.clip(column, 0, width - 1).astype(int)].astype(float)

    upper = at(top, left) * (1 - s) + at(top, left + 1) * s
    lower = at(top + 1, left) * (1 - s) + at(top + 1, left + 1) * s
    return upper * (1 - t) + lower * t


def _round_trip(
    camera: Camera, other: Camera, x: np.ndarray, y: np.ndarray, u: np.ndarray, v: np.ndarray, theirs: np.ndarray
) -> np.ndarray:
    rows = np.clip(np.floor(v + 0.5), 0, other.height - 1).astype(int)
    columns = np.clip(np.floor(u + 0.5), 0, other.width - 1).astype(int)
    w = theirs[rows, columns].astype(np.float64)
    p, q, z = (row[0] * u + row[1] * v + row[2] + row[3] * w for row in warp(other, camera))
    z = np.maximum(z, NEAREST)
    error = np.minimum(np.hypot(p / z - x, q / z - y), MAX_REPROJECTION_PX)
    return np.where(w > 0, error, MAX_REPROJECTION_PX)
