"""Estimates a distorted lens where the pinhole camera that a capture gives is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.captures.lens import Lens
from room2dgs.captures.point_cloud import Tracks
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.adjust import SEEN, adjusted, consistent, spread_of
from room2dgs.sfm.bundle import lens_adjusted
from room2dgs.sfm.feature_tracks import covering, judges_and_used, some
from room2dgs.sfm.structure import track_errors

LEAST_TRACKS = 500
ROUNDS = 2  # of poses alone, before the lens is free, too
# Of the held-out error of before, that a lens has to leave at most: a free lens takes up a little of what poses are
# off, too (0.98 to 0.99 with 1 degree and 2 cm of noise).
SHARE = 0.96
LEAST_PX = 0.1  # root mean square over the photo; nothing that follows sees less
MOST = 0.1  # of the photo's width and of the focal length: more is no correction of given intrinsics


class LensFound(NamedTuple):
    """The lens estimated from photos.

    Attributes:
        lens: at the cameras' size.
        before_px, after_px: median reprojection errors of held-out tracks with adjusted poses, without and with it.
        moved_px: root mean square over the photo of the distance between its and the given camera's projections.
        focal: its focal lengths over the given ones, horizontal and vertical.
    """

    lens: Lens
    before_px: float
    after_px: float
    moved_px: float
    focal: tuple[float, float]


def found_lens(given: Sequence[Camera], tracks: Tracks) -> LensFound | None:
    """One lens for all photos, where it fits held-out tracks clearly better than the given pinhole camera.

    None if it does not, if the cameras differ, or if there are few tracks.

    Args:
        given: pinhole cameras; their poses may be a little off.
        tracks: of all of them, sorted by point.
    """
    first = given[0]
    alike = all(camera.size == first.size and np.array_equal(camera.K, first.K) for camera in given)
    count = int(tracks.point.max()) + 1 if len(tracks) else 0
    if not alike or count < LEAST_TRACKS:
        return None
    judges, used = judges_and_used(tracks)
    used = some(used, covering(used, SEEN))
    cameras, known, _ = adjusted(given, used, rounds=ROUNDS)
    fitting, xyz, loss_px = consistent(cameras, used)
    if not known.any() or not len(fitting):
        return None
    spread = spread_of(cameras, given, known, fitting)
    moved, lens = lens_adjusted(cameras, given, fitting, xyz, loss_px, spread)
    before = float(np.nanmedian(track_errors(cameras, judges)))
    after = float(np.nanmedian(track_errors(moved, straightened(judges, lens, first))))
    grid = np.stack(np.meshgrid(*(np.linspace(0, side, 17) for side in first.size)), axis=-1).reshape(-1, 2)
    off = lens.project(np.column_stack([(grid - first.K[:2, 2]) / first.K[(0, 1), (0, 1)], np.ones(len(grid))])) - grid
    away = float(np.sqrt((off**2).sum(axis=1).mean()))
    focal = lens.K[(0, 1), (0, 1)] / first.K[(0, 1), (0, 1)]
    clearly = after <= SHARE * before and away >= LEAST_PX
    plausible = away <= MOST * first.width and np.abs(focal - 1).max() <= MOST
    if not (clearly and plausible):
        return None
    return LensFound(lens, before, after, away, (float(focal[0]), float(focal[1])))


def straightened(tracks: Tracks, lens: Lens, camera: Camera) -> Tracks:
    """The observations without distortion: where a pinhole camera with this K sees them."""
    pixel = lens.rays_at(tracks.pixel.astype(np.float64)) * camera.K[(0, 1), (0, 1)] + camera.K[:2, 2]
    return Tracks(tracks.frames, tracks.frame, tracks.point, pixel)
