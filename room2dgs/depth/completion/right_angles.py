"""Planes of a room that are almost parallel, or almost at right angles, are so.

A wall or floor of which photos see little is found tilted by degrees; the planes around it say how it stands.
"""

from __future__ import annotations

import numpy as np

from room2dgs.geometry.cells import cells_of
from room2dgs.geometry.rotations import across_of

EXACT_DEG = 0.5  # how exactly builders and joiners keep to a right angle
DOUBTFUL_DEG = 1.0  # planes known exactly that are off a right angle by this much probably stand at another angle
MOST_DOUBT_DEG = 3.0  # that uncertain directions add to it
CELL_M = 0.6  # errors farther apart than this are taken for independent of each other
ALIKE = 5.0  # which they are not: true errors of directions are this many times what cells say, by measured rooms
LEAST_ERROR_DEG = 0.3  # of any plane's direction
UNKNOWN_DEG = 30.0  # error of a direction that too few cells speak of
STEPS = 30


def direction_covariance(xyz: np.ndarray, off: np.ndarray, weight: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """How well the direction of a fitted plane is known, by how its surface waves (docs/how-it-works/depth.md).

    The covariance of least squares whose errors are alike within cells (the "sandwich" of White and Huber, clustered):
    a plane whose parts lie before and behind it by turns may be tilted, one that is flat throughout is not.

    Args:
        xyz: (N, 3) metres, points on the plane, world frame.
        off: (N,) metres, their distances from it.
        weight: (N,) of each in the fit.
        normal: (3,) unit.

    Returns:
        (3, 3) of the change of the unit normal, 0 along the normal; never less than `LEAST_ERROR_DEG`.
    """
    across = across_of(normal)
    flat = np.eye(3) - np.outer(normal, normal)
    cells, cell = cells_of(xyz, CELL_M)
    lever = np.column_stack([(xyz * axis).sum(axis=1) for axis in across])
    lever = lever - (weight[:, None] * lever).sum(axis=0) / weight.sum()
    off = off - (weight * off).sum() / weight.sum()
    spread = np.einsum("n,ni,nj->ij", weight, lever, lever)  # einsum, not BLAS, whose bits depend on its threads
    spare = len(cells) - 3  # a plane takes three numbers
    if spare < 1 or np.linalg.cond(spread) > 1e6:
        return flat * np.radians(UNKNOWN_DEG) ** 2
    pull = np.column_stack([np.bincount(cell, weight * off * column, len(cells)) for column in lever.T])
    inverse = np.linalg.inv(spread)
    slope = inverse @ np.einsum("ci,cj->ij", pull, pull) @ inverse * len(cells) / spare
    return np.asarray(ALIKE**2 * across.T @ slope @ across + np.radians(LEAST_ERROR_DEG) ** 2 * flat)


def turned(normals: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Directions of planes that agree with each other as far as they are known.

    The planes in order of how well they are known; each takes the direction that is most probable by its own fit and
    by those before it, to which it is drawn where it is almost parallel or at a right angle with them (Geman and
    McClure: the less, the more it is off). So no plane is turned by one that is known less.

    Args:
        normals: (P, 3) unit.
        covariances: (P, 3, 3) as `direction_covariance` gives them.

    Returns:
        (P, 3) unit; the same input gives the same bits.
    """
    found = normals.copy()
    exact, doubtful, most = (np.radians(one) ** 2 for one in (EXACT_DEG, DOUBTFUL_DEG, MOST_DOUBT_DEG))
    order = np.argsort([np.linalg.eigvalsh(one)[-1] for one in covariances], kind="stable")
    for place, one in enumerate(order):
        upright = np.outer(normals[one], normals[one])
        known = np.linalg.inv(covariances[one] + upright) - upright
        moved = np.zeros(3)
        for _ in range(STEPS if place else 0):
            left, right = known.copy(), -known @ moved
            for other in order[:place]:
                for way, its_way, off in _ways(found[one], found[other]):
                    mine, its = way @ covariances[one] @ way, its_way @ covariances[other] @ its_way
                    weight = (1 + off**2 / (doubtful + min(mine + its, most))) ** -2 / (exact + its)
                    left += weight * np.outer(way, way)
                    right -= weight * off * way
            stiff = np.trace(left) * np.outer(found[one], found[one])  # no step along the normal
            step = np.linalg.solve(left + stiff, right)
            moved += step
            found[one] = (found[one] + step) / np.linalg.norm(found[one] + step)
    return found


def _ways(one: np.ndarray, other: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Unit ways to move a normal, or the other one, for them to be parallel or at a right angle, whichever is nearer,
    and by how much they are off, radians."""
    along = float(one @ other)
    if abs(along) < np.sqrt(0.5):
        ways = (other - along * one, one - along * other)
        return [(ways[0] / np.linalg.norm(ways[0]), ways[1] / np.linalg.norm(ways[1]), along)]
    return [(axis, axis, -float(np.sign(along) * (other @ axis))) for axis in across_of(one)]
