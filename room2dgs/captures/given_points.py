"""Sparse points of a capture as its training views observe them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from room2dgs.captures.capture import Capture, RawPoints
from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame


def given_points(capture: Capture, frames: Sequence[Frame], shots: Mapping[str, str], unit: float | None) -> PointCloud:
    """The capture's points in its own world, metres, with the observations of some frames.

    Args:
        frames: the views whose observations count; those in masked pixels and outside the working image do not.
        shots: frame name -> shot name.
        unit: metres of one unit of the capture; None: 1.

    Returns:
        All points that are some, those that no frame saw too; without tracks where the capture has none.
    """
    assert capture.points is not None, "the capture brings no points"
    raw = capture.points()
    xyz = np.asarray(raw.xyz, np.float64).reshape(-1, 3)
    real = _real(xyz)
    with np.errstate(over="ignore", invalid="ignore"):  # what is too far to be a point is left out too
        found = _observed(capture, raw, np.where(real[:, None], xyz, 0.0), frames, shots, unit)
    real &= np.isfinite(found.xyz).all(axis=1)
    if real.all():
        return found
    return replace(found.chosen(real), left_out=int((~real).sum()))


def _real(xyz: np.ndarray) -> np.ndarray:
    """(M,) bool: not those that are not finite, nor several at the origin: places that nobody filled in."""
    empty = (xyz == 0).all(axis=1)
    return np.isfinite(xyz).all(axis=1) & ~(empty if empty.sum() > 1 else np.zeros(len(xyz), bool))


def _observed(
    capture: Capture,
    raw: RawPoints,
    xyz: np.ndarray,
    frames: Sequence[Frame],
    shots: Mapping[str, str],
    unit: float | None,
) -> PointCloud:
    if capture.world_from_disk is not None:
        xyz = xyz @ capture.world_from_disk[:3, :3].T + capture.world_from_disk[:3, 3]
    if unit is not None:
        xyz = xyz * unit
    if raw.shot is None or raw.point is None or raw.pixel is None:
        return PointCloud(xyz, raw.rgb)
    number = {name: index for index, name in enumerate(raw.shots)}
    meant = {shot.name: shot.lens.size for shot in capture.shots if shot.lens is not None}
    order = np.argsort(raw.shot, kind="stable")
    bounds = np.searchsorted(raw.shot[order], np.arange(len(raw.shots) + 1))
    parts = []
    for index, frame in enumerate(frames):
        if shots[frame.name] not in number:
            continue
        place = number[shots[frame.name]]
        rows = order[bounds[place] : bounds[place + 1]]
        stored = frame.lens.known_size if frame.lens else frame.full_size()
        resized = np.divide(stored, meant.get(raw.shots[place]) or stored)  # after the model was made
        point, pixel = raw.point[rows], working_pixel(frame, raw.pixel[rows] * resized)
        good = _usable(frame, pixel)
        point, pixel = point[good], pixel[good]
        # a track may hold two features of one photo: the first counts
        point, first = np.unique(point, return_index=True)
        parts.append((np.full(len(point), index, np.int32), point.astype(np.int32), pixel[first].astype(np.float32)))
    if not parts:
        return PointCloud(xyz, raw.rgb)
    seen_by, point, pixel = (np.concatenate(column) for column in zip(*parts, strict=True))
    return PointCloud(xyz, raw.rgb, Tracks(tuple(frame.name for frame in frames), seen_by, point, pixel))


def working_pixel(frame: Frame, pixel: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of the photo as stored -> of the frame's camera."""
    pixel = np.asarray(pixel, np.float64).reshape(-1, 2)
    if frame.lens is None:
        return pixel * np.array(frame.camera.size) / frame.full_size()
    K = frame.camera.K
    return frame.lens.rays_at(pixel) * K[(0, 1), (0, 1)] + K[:2, 2]


def _usable(frame: Frame, pixel: np.ndarray) -> np.ndarray:
    good = frame.camera.inside(pixel)
    mask = frame.mask()
    if mask is not None:
        column, row = np.floor(np.where(good[:, None], pixel, 0)).astype(np.int64).T
        good &= mask[row, column]
    return good
