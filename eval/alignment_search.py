"""Initial transforms between two surfaces of one room in different frames.

Most of a room's surface has one of three normal directions. These main axes are found in both meshes; each of the 24
rotations that map one set of axes to the other is a candidate. The shift along each axis is the one that puts most
walls on walls, the scale is the ratio of the extents.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from room2dgs.errors import InputError

NEAR = np.cos(np.radians(12.0))  # normals that look the same way
CANDIDATES = 500
ACROSS = 0.5  # |cosine| under which a direction is another one
EDGE = 0.03  # share of the samples at either end that may be stray
FACING = 0.9  # |cosine| of a surface across an axis
BIN_M = 0.05
LONGEST_M = 1000.0  # of a room; the search takes the square of it


def guesses(
    points: np.ndarray, normals: np.ndarray, truth_points: np.ndarray, truth_normals: np.ndarray, with_scale: bool
) -> list[np.ndarray]:
    """(4, 4) candidate similarities from points (N, 3) to the truth's; normals are unit vectors of either sign."""
    axes, truth_axes = main_axes(normals), main_axes(truth_normals)
    truth_points, truth_normals = truth_points @ truth_axes, truth_normals @ truth_axes
    reach = _reach(truth_points)
    found = []
    for turn in cube_turns():
        turned, turned_normals = points @ axes @ turn.T, normals @ axes @ turn.T
        ratios = sorted(reach / np.maximum(_reach(turned), 1e-9))
        for scale in {1.0, *ratios} if with_scale else {1.0}:
            matrix = np.eye(4)
            matrix[:3, :3] = scale * truth_axes @ turn @ axes.T
            shift = [
                _shift(
                    scale * turned[np.abs(turned_normals[:, axis]) > FACING, axis],
                    truth_points[np.abs(truth_normals[:, axis]) > FACING, axis],
                )
                for axis in range(3)
            ]
            matrix[:3, 3] = truth_axes @ shift
            found.append(matrix)
    return found


def _reach(points: np.ndarray) -> np.ndarray:
    """(3,) extent of points along each axis, without outliers."""
    low, high = np.quantile(points, (EDGE, 1 - EDGE), axis=0)
    return high - low


def _shift(places: np.ndarray, truth_places: np.ndarray) -> float:
    """The shift along an axis that puts most surfaces across it on those of the truth."""
    if not len(places) or not len(truth_places):
        return 0.0
    low, truth_low = places.min(), truth_places.min()
    across = float(max(np.ptp(places), np.ptp(truth_places)))
    if across > LONGEST_M:
        raise InputError(
            f"eval.align=icp finds rooms of up to {LONGEST_M:.0f} m, and one of the meshes is {across:.3g} m across; "
            "is it in millimetres? Scale it to metres, or give eval.align_scene=DIR to start from"
        )
    counts, truth_counts = (
        np.convolve(np.bincount(((values - start) / BIN_M).astype(int)), (0.25, 0.5, 0.25))
        for values, start in ((places, low), (truth_places, truth_low))
    )
    # the root, so that one large wall does not outweigh two others
    fits = np.correlate(np.sqrt(truth_counts), np.sqrt(counts), "full")
    return truth_low - low + BIN_M * (int(fits.argmax()) - (len(counts) - 1))


def main_axes(normals: np.ndarray) -> np.ndarray:
    """(3, 3) rotation whose columns are the direction that most normals share, of either sign, the strongest of those
    across it, and what is across both."""
    first = _strongest(normals, normals)
    second = _strongest(normals, normals[np.abs(normals @ first) < ACROSS])
    second -= (second @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _strongest(normals: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """The one of the candidates that most normals are near to, then their mean."""
    if not len(candidates):  # one plane: any direction in it does
        axis = np.eye(3)[np.abs(normals[0]).argmin()]
        return np.cross(normals[0], axis) / np.linalg.norm(np.cross(normals[0], axis))
    chosen = candidates[np.linspace(0, len(candidates) - 1, min(CANDIDATES, len(candidates))).astype(int)]
    direction = chosen[(np.abs(chosen @ normals.T) > NEAR).sum(axis=1).argmax()]
    for _ in range(5):
        cosine = normals @ direction
        near = np.abs(cosine) > NEAR
        direction = (normals[near] * np.sign(cosine[near])[:, None]).sum(axis=0)
        direction /= np.linalg.norm(direction)
    return direction


def cube_turns() -> list[np.ndarray]:
    """The 24 rotations that lay axes on axes."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(matrix) > 0:
            found.append(matrix)
    return found
