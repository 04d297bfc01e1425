"""Where the room's planes lie, by stereo and by where photos see them meet.

What stereo finds on a bare wall is what it was led to assume, so that all of the wall may lie centimetres off; its
creases with floor, ceiling and other walls do not. On a textured wall stereo is the more exact.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.depth.completion.creases import Creases, SeenPlanes, creases_in
from room2dgs.depth.completion.planes import Plane
from room2dgs.geometry.rotations import across_of

WIDTH_PX = 0.65  # distance from where planes meet at which a pixel starts to count as one of something else
REWEIGHTINGS = 8
# Where stereo has a plane is off by this over its mean weight, metres, and by no less than that.
STEREO_M, LEAST_M = 0.008, 0.003
UNKNOWN_M = 0.04  # what a plane is off by at most, before creases are used
REACH_M, SPREAD_M = 0.1, 0.02  # farther off a plane stereo sees something else; distance at which it starts to
MIDDLE_STEP = 4  # every so many pixels of every so many rows tell a plane's middle
LEAST_TILT, TILT_PER_M = 0.001, 0.15  # radians that a direction is off by, and what it is for each metre that stereo is


def refined_at_creases(planes: Sequence[Plane], seen: Sequence[SeenPlanes]) -> list[Plane]:
    """The same planes, moved and tilted so that they meet where photos see them meet.

    Minimises sum ((d_k - a_k) / e_k)^2 + (d_k / UNKNOWN_M)^2 + |t_k / s_k|^2 + sum over the pixels of creases of w
    (pixels off)^2 over the moves d and the tilts t. a is of stereo itself, not of the completed depth, which
    the planes of an earlier round have drawn to them. Reweighted (Geman and McClure), since many an edge between two
    planes is that of something that stands before them (docs/how-it-works/depth.md, "Fit planes").

    Args:
        planes: the room's.
        seen: of all photos.
    """
    normals = np.array([plane.normal for plane in planes]).reshape(-1, 3)
    offsets = np.array([plane.offset for plane in planes])
    creases = creases_in(seen, normals, offsets)
    if not len(creases.off):
        return list(planes)
    count = len(planes)
    at, error = _by_stereo(normals, offsets, seen)
    centres = _centres(normals, offsets, seen)
    tilt = np.hypot(LEAST_TILT, TILT_PER_M * np.minimum(error, UNKNOWN_M))
    sure = np.stack([1 / np.hypot(LEAST_M, error) ** 2 + UNKNOWN_M**-2, 1 / tilt**2, 1 / tilt**2], axis=1)
    pull = np.stack([at / np.hypot(LEAST_M, error) ** 2, np.zeros(count), np.zeros(count)], axis=1)
    across = np.array([across_of(normal) for normal in normals])
    gains = _gains(creases, centres, across)
    columns = (3 * creases.planes[..., None] + np.arange(3)).reshape(-1, 6)
    move = np.zeros(3 * count)
    for _ in range(REWEIGHTINGS):
        residual = creases.off + (gains * move[columns]).sum(axis=1)
        weight = creases.weight / (1 + (residual / WIDTH_PX) ** 2) ** 2
        move = _least_squares(gains, columns, weight, creases.off, sure.ravel(), pull.ravel())
    moves = move.reshape(count, 3)
    return [_moved(*one) for one in zip(planes, centres, across, moves, strict=True)]


def _gains(creases: Creases, centres: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(N, 6) pixels that are added for each metre and radian of both planes' moves."""
    lever = np.einsum("npd,npkd->npk", creases.at[:, None] - centres[creases.planes], across[creases.planes])
    moves = np.concatenate([np.ones((*lever.shape[:2], 1)), lever], axis=2)
    return np.asarray((creases.gain[..., None] * moves).reshape(-1, 6))


def _least_squares(
    gains: np.ndarray, columns: np.ndarray, weight: np.ndarray, off: np.ndarray, sure: np.ndarray, pull: np.ndarray
) -> np.ndarray:
    count = len(sure)
    left, right = np.diag(sure), pull.copy()
    for one, mine in zip(columns.T, (weight[:, None] * gains).T, strict=True):
        right -= np.bincount(one, mine * off, count)
        for other, its in zip(columns.T, gains.T, strict=True):
            left += np.bincount(one * count + other, mine * its, count * count).reshape(count, count)
    return np.linalg.solve(left, right)


def _moved(plane: Plane, centre: np.ndarray, across: np.ndarray, move: np.ndarray) -> Plane:
    """Its points x move by d + t · (x - centre) along the normal."""
    tilt = move[1:] @ across
    normal, offset = plane.normal - tilt, plane.offset + move[0] - tilt @ centre
    length = np.linalg.norm(normal)
    return plane._replace(normal=normal / length, offset=float(offset / length))


def _by_stereo(normals: np.ndarray, offsets: np.ndarray, seen: Sequence[SeenPlanes]) -> tuple[np.ndarray, np.ndarray]:
    """(P,) metres by which stereo has each plane before its place, and (P,) what that is off by."""
    count, parts = len(offsets), []
    shown = sum(np.bincount(one.which[one.which >= 0], minlength=count) for one in seen)
    for one in seen:
        row, column = np.nonzero((one.which >= 0) & (one.sample > 0))
        which = one.which[row, column]
        xyz = one.camera.unproject(np.stack([column, row], axis=1) + 0.5, one.sample[row, column])
        parts.append((which, (xyz * normals[which]).sum(axis=1) - offsets[which], one.sample_weight[row, column]))
    which, off, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    mean = np.bincount(which, weights, count) / np.maximum(shown, 1)
    near = np.abs(off) < REACH_M
    which, off, weights = which[near], off[near], weights[near]
    at = np.zeros(count)
    for _ in range(REWEIGHTINGS):
        weight = weights / (1 + ((off - at[which]) / SPREAD_M) ** 2) ** 2
        at = np.bincount(which, weight * off, count) / np.maximum(np.bincount(which, weight, count), 1e-9)
    return at, STEREO_M / np.maximum(mean, 1e-3)


def _centres(normals: np.ndarray, offsets: np.ndarray, seen: Sequence[SeenPlanes]) -> np.ndarray:
    """(P, 3) metres, about the middle of what the photos show of each plane, world frame: a few of its pixels' mean."""
    total, count = np.zeros(normals.shape), np.zeros(len(offsets))
    for one in seen:
        few = (slice(1, None, MIDDLE_STEP), slice(1, None, MIDDLE_STEP))
        which, rays = one.which[few], one.camera.rays()[few] @ one.camera.rotation
        which, rays = which[which >= 0], rays[which >= 0]
        facing = np.minimum((rays * normals[which]).sum(axis=1), -1e-3)
        xyz = one.camera.centre + rays * ((offsets - normals @ one.camera.centre)[which] / facing)[:, None]
        total += np.stack([np.bincount(which, axis, len(offsets)) for axis in xyz.T], axis=1)
        count += np.bincount(which, minlength=len(offsets))
    return np.asarray(total / np.maximum(count, 1)[:, None])
