"""Large planes of a room: found in the completed depth of all views together.

One view's depth of a blank wall may be off by decimetres; the plane through what all views have of that wall seldom is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.depth.completion.right_angles import direction_covariance, turned

LEAST_SHARE = 0.01  # of all samples, that have to lie on a plane
MOST = 24  # planes
DRAWN = 60000  # samples that are used
TRIED, FIRST_AGAINST = 600, 1000  # candidates in each round, and samples that judge them all
FINAL, AGAINST = 40, 6000  # the best of them, and samples that judge these
AT_ONCE = 40  # candidates judged together
WIDTH_M, WIDTH_RELATIVE = 0.02, 0.012  # distance from a plane at which a sample starts to count as off it
TURN = 0.94  # least cosine between normals of a candidate and of a sample that speaks for it
FACING = 0.9  # the same, of a plane and of a sample that lies on it
REFITS = 8
# A plane's direction is that of its most exact samples: none counts as more exact than this,
EXACT_M, EXACT_RELATIVE = 0.006, 0.004
# and those count that are as near as most of them are, up to this share of the widths above.
NARROW, MIDDLES = 0.15, 1.5
FEWEST = 200  # samples left that are enough for another round


class Samples(NamedTuple):
    """Points on surfaces.

    Attributes:
        xyz: (N, 3) metres, world frame.
        normal: (N, 3) unit, world frame, towards the camera.
        depth: (N,) metres, from the camera that saw it.
        weight: (N,) how often to draw it: area on the surface times confidence.
        error: (N,) metres, expected of its depth.
    """

    xyz: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    weight: np.ndarray
    error: np.ndarray


class Plane(NamedTuple):
    """normal · x = offset.

    Attributes:
        normal: (3,) unit, world frame, towards the cameras.
        offset: metres.
        share: of the samples that lie on it.
    """

    normal: np.ndarray
    offset: float
    share: float


def find_planes(samples: Samples, *, right_angles: bool, width: float = 1.0) -> list[Plane]:
    """Planes, the largest first, each sample on one of them; the same input gives the
    same bits.

    Candidates are samples with their own normals. The one that most samples lie on is refitted to them by reweighted
    least squares (Geman and McClure), they are taken out, and the rest is searched again. A plane's direction is that
    of its most exact samples, since a few that are centimetres off tilt it; its place is that of all, since those that
    are sure of themselves may be off together.

    Args:
        samples: of all views.
        right_angles: planes that are almost parallel or at right angles, as far as their directions are known, are so.
        width: times `WIDTH_M` and `WIDTH_RELATIVE`: how exact the samples are.
    """
    generator = np.random.default_rng(0)
    total = samples.weight.sum()
    if len(samples.xyz) < FEWEST or not total > 0:
        return []
    at_once = min(DRAWN, int(np.count_nonzero(samples.weight)))
    probability: np.ndarray = samples.weight / total
    drawn = generator.choice(len(samples.xyz), at_once, replace=False, p=probability)
    xyz, normal = samples.xyz[drawn].astype(np.float64), samples.normal[drawn].astype(np.float64)
    depth = samples.depth[drawn]
    widths = width * np.maximum(WIDTH_M, WIDTH_RELATIVE * depth)
    exact = 1 / (np.maximum(EXACT_M, EXACT_RELATIVE * depth) ** 2 + samples.error[drawn] ** 2)
    exact /= exact.mean()
    free = np.ones(len(xyz), bool)
    planes: list[Plane] = []
    members: list[tuple[np.ndarray, np.ndarray]] = []
    for _ in range(MOST):
        left = np.nonzero(free)[0]
        if len(left) < FEWEST:
            break
        start = _best_candidate(xyz, normal, widths, left, generator)
        direction, offset = _refitted(xyz[left], normal[left], widths[left], *start)
        direction, offset = _exactly(xyz[left], normal[left], widths[left], exact[left], direction, offset)
        on = free & (np.abs(_along(xyz, direction) - offset) < 2.5 * widths) & (_along(normal, direction) > FACING)
        share = float(on.sum()) / len(xyz)
        if share < LEAST_SHARE / 3:  # the best that there is
            break
        free &= ~on
        if share >= LEAST_SHARE:
            planes.append(Plane(direction, _offset(_along(xyz[on], direction), widths[on]), share))
            members.append((xyz[on], widths[on]))
    if right_angles and len(planes) > 1:
        planes = _squared(planes, members)
    return sorted(planes, key=lambda plane: -plane.share)


def _best_candidate(
    xyz: np.ndarray, normal: np.ndarray, width: np.ndarray, left: np.ndarray, generator: np.random.Generator
) -> tuple[np.ndarray, float]:
    judges = generator.choice(left, min(len(left), AGAINST), replace=False)
    candidates = generator.choice(left, min(len(left), TRIED), replace=False)
    offset = (normal[candidates] * xyz[candidates]).sum(axis=1)

    def inliers(some: np.ndarray, by: np.ndarray) -> np.ndarray:
        """How many of the judges lie on each candidate."""
        count = np.empty(len(some), np.int64)
        for part in range(0, len(some), AT_ONCE):
            index = candidates[some[part : part + AT_ONCE]]
            direction = normal[index].T[..., None]
            near = np.abs(_along(xyz[by], direction) - offset[some[part : part + AT_ONCE], None]) < 2 * width[by]
            count[part : part + AT_ONCE] = (near & (_along(normal[by], direction) > TURN)).sum(axis=1)
        return count

    first = inliers(np.arange(len(candidates)), judges[:FIRST_AGAINST])
    final = np.argsort(-first, kind="stable")[:FINAL]
    best = final[inliers(final, judges).argmax()]  # the first of equals
    return normal[candidates[best]], float(offset[best])


def _refitted(
    xyz: np.ndarray, normal: np.ndarray, width: np.ndarray, direction: np.ndarray, offset: float
) -> tuple[np.ndarray, float]:
    scale = 3.0
    for _ in range(REFITS):
        off = (_along(xyz, direction) - offset) / (scale * width)
        weight = np.where((np.abs(off) < 2.5) & (_along(normal, direction) > FACING), 1 / (1 + off**2), 0)
        if np.count_nonzero(weight) < 50:
            break
        direction, offset = _least_squares(xyz, weight, direction)
        scale = max(1.0, 0.8 * scale)
    return direction, offset


def _exactly(
    xyz: np.ndarray, normal: np.ndarray, width: np.ndarray, exact: np.ndarray, direction: np.ndarray, offset: float
) -> tuple[np.ndarray, float]:
    """The plane of the exact samples and of those near it."""
    narrow = 1.0
    for _ in range(REFITS):
        off = (_along(xyz, direction) - offset) / width
        near = (np.abs(off) < 2.5 * narrow) & (_along(normal, direction) > FACING)
        if np.count_nonzero(near) < 50:
            break
        narrow = min(narrow, max(NARROW, MIDDLES * float(np.median(np.abs(off[near])))))
        weight = np.where(near, exact / (1 + (off / narrow) ** 2) ** 2, 0)
        direction, offset = _least_squares(xyz, weight, direction)
    return direction, offset


def _least_squares(xyz: np.ndarray, weight: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, float]:
    """Direction and offset of the plane through weighted points."""
    centre = np.einsum("n,nd->d", weight, xyz) / weight.sum()
    spread = xyz - centre
    # einsum, not BLAS, whose bits depend on its threads.
    least = np.linalg.eigh(np.einsum("n,ni,nj->ij", weight, spread, spread))[1][:, 0]
    direction = least if least @ towards > 0 else -least
    return direction, float(direction @ centre)


def _squared(planes: Sequence[Plane], members: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Plane]:
    """The same planes, their directions adjusted to each other; of each, its points and their widths.

    How well a direction is known all samples say, not the exact ones, which may be off together.
    """
    covariances = []
    for plane, (xyz, width) in zip(planes, members, strict=True):
        off = _along(xyz, plane.normal)
        off -= off.mean()
        covariances.append(direction_covariance(xyz, off, 1 / (1 + (off / width) ** 2), plane.normal))
    normals = turned(np.stack([plane.normal for plane in planes]), np.stack(covariances))
    return [
        Plane(normal, _offset(_along(xyz, normal), width), plane.share)
        for normal, plane, (xyz, width) in zip(normals, planes, members, strict=True)
    ]


def _offset(along: np.ndarray, width: np.ndarray) -> float:
    """Where on its normal a plane lies best among points."""
    offset = float(np.median(along))
    for _ in range(REFITS):
        weight = (1 + ((along - offset) / width) ** 2) ** -2.0
        offset = float((weight * along).sum() / weight.sum())
    return offset


def _along(vectors: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return vectors[:, 0] * direction[0] + vectors[:, 1] * direction[1] + vectors[:, 2] * direction[2]
