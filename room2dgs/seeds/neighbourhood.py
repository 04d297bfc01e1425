"""Normal and spacing of the surface around a seed, from the points near it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from room2dgs.geometry.arguments import check_points, number, whole_number

FLAT = 1e-6  # variance below this share of the largest counts as none


def local_normals(points: np.ndarray, at: np.ndarray, neighbours: int, towards: np.ndarray) -> np.ndarray:
    """Normals by principal components of the nearest points.

    Where the neighbours lie on a line or in one place, no plane is defined: the normal then points
    at `towards` as far as the line allows.

    Args:
        points: (M, 3) metres; repeated points count once.
        at: (S, 3) places to estimate normals at, metres.
        neighbours: nearest points to use (fewer if there are fewer).
        towards: (3,) a place in front of the surfaces, such as the mean camera centre.

    Returns:
        (S, 3) float64 unit normals on the side of `towards`.

    Raises:
        TypeError, ValueError: no points, no such places, no number of neighbours.
    """
    points, at = check_points("points", points), check_points("at", at)
    check_points("towards", np.asarray(towards)[None])
    whole_number("neighbours", neighbours, 1)
    if not len(points) or not np.isfinite(points).all() or not np.isfinite(at).all():
        raise ValueError("points are none, or some are not finite")
    distinct = np.unique(np.asarray(points, dtype=np.float64), axis=0)
    at = np.asarray(at, dtype=np.float64)
    count = min(neighbours, len(distinct))
    _, nearest = cKDTree(distinct).query(at, k=list(range(1, count + 1)))
    local = distinct[nearest]  # (S, count, 3)
    local = local - local.mean(axis=1, keepdims=True)
    covariance = np.einsum("sni,snj->sij", local, local)
    variances, axes = np.linalg.eigh(covariance)  # ascending
    normals = axes[:, :, 0]

    view = towards - at
    line = variances[:, 1] <= FLAT * variances[:, 2]
    place = variances[:, 2] <= np.finfo(np.float64).tiny
    along = np.where(place[:, None], 0.0, axes[:, :, 2])
    seen = view - np.sum(view * along, axis=1, keepdims=True) * along
    length = np.linalg.norm(seen, axis=1, keepdims=True)
    # a line that points straight at the camera leaves any normal across it
    usable = (line | place)[:, None] & (length > 1e-9 * (1.0 + np.linalg.norm(view, axis=1, keepdims=True)))
    normals = np.where(usable, seen / np.where(length > 0, length, 1.0), normals)
    side = np.where(np.sum(normals * view, axis=1) < 0, -1.0, 1.0)
    return normals * side[:, None]


def spacing(positions: np.ndarray, low_m: float, high_m: float, squared: bool = False) -> np.ndarray:
    """Mean distance to the three nearest others, clamped.

    Args:
        positions: (S, 3) metres, distinct.
        low_m, high_m: bounds of the result; with fewer than two positions it is `high_m`.
        squared: the root of the mean square instead, as 2DGS has it.

    Returns:
        (S,) float64 metres.

    Raises:
        TypeError, ValueError: no such finite positions, or bounds that are none.
    """
    positions = check_points("positions", positions)
    if not np.isfinite(positions).all():
        raise ValueError("positions are not finite")
    if number("high_m", high_m, above=0.0) < number("low_m", low_m, least=0.0):
        raise ValueError(f"low_m {low_m} is above high_m {high_m}")
    count = min(3, len(positions) - 1)
    if count < 1:
        return np.full(len(positions), high_m)
    distances, _ = cKDTree(positions).query(positions, k=list(range(2, count + 2)))
    mean = np.sqrt(np.square(distances).mean(axis=1)) if squared else distances.mean(axis=1)
    return np.clip(mean, low_m, high_m)
