"""Pose refinement by rounds of triangulation and bundle adjustment, from poses with small errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from room2dgs.captures.point_cloud import Tracks
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.bundle import Spread, aligned, bundle_adjusted, focal_adjusted, moves
from room2dgs.sfm.feature_tracks import MIN_TRACK, covering, some
from room2dgs.sfm.structure import parallax_deg, reprojection_errors, track_errors, triangulated

ROUNDS = 5
FINE_ROUNDS = 2
SEEN = 300  # observations of a photo that are enough; more cost time
LEAST_SEEN = 20  # photos with fewer keep their pose
LEAST_TOGETHER = 4  # and so do smaller groups of photos that no track joins to the others
LOSS_PX = 1.0
CUT = 5.0  # times the loss's scale: observations beyond it are not of this point
MIN_PARALLAX_DEG = 1.0
# What is known of given poses and of observations, at first and at least. Too wide, and photos that share little go
# astray in the first round; then it follows from how far the cameras went and from the errors that are left. These are
# smaller than what an observation is worth: photos that look alike find a feature in the same wrong place.
FIRST, LEAST = Spread(0.01, 0.5, 0.5), Spread(0.002, 0.05, 0.4)
MEDIAN_LENGTH, MEDIAN_IN_PLANE = 1.538, 1.177  # of a vector of three (two) coordinates with unit deviation


class Adjusted(NamedTuple):
    """Poses that fit tracks.

    Attributes:
        cameras: those that had too few tracks to be adjusted are as given.
        known: (V,) bool: those that had enough.
        scale_change: relative change of the scale of the largest group by all bundle adjustments, which the alignment
            took back.
    """

    cameras: list[Camera]
    known: np.ndarray
    scale_change: float


def adjusted(
    given: Sequence[Camera],
    tracks: Tracks,
    start: Sequence[Camera] | None = None,
    rounds: int = ROUNDS,
    focal: bool = False,
) -> Adjusted:
    """Poses that fit the tracks, in the frame and scale of the given ones.

    Each round triangulates with the poses of the round before, drops the observations with large errors, runs a bundle
    adjustment and aligns its result to the given frame. The more the centres have moved, the weaker is their prior.

    Args:
        given: cameras, a little off: degrees and centimetres.
        tracks: of all of them, sorted by point.
        start: cameras of an earlier round; None: the given ones.
        rounds: at most; the last two have errors of a pixel or less.
        focal: the focal length is adjusted, too, if all cameras have the same K.
    """
    scale = 1.0
    cameras, known = list(start or given), np.zeros(len(given), bool)
    if len(tracks):
        tracks = some(tracks, covering(tracks, SEEN))
    spread, fine = FIRST, 0
    adjust = focal_adjusted if focal and same_intrinsics(given) else bundle_adjusted
    for _ in range(rounds):
        fitting, xyz, loss_px = consistent(cameras, tracks)
        groups = _groups(fitting, len(given))
        known = groups >= 0
        if not known.any():
            break
        moved = adjust(cameras, given, fitting, xyz, loss_px, spread)
        largest = int(np.bincount(groups[known]).argmax())
        for group in range(groups.max() + 1):
            moved, held = aligned(moved, given, groups == group)
            scale /= held if group == largest else 1.0
        still = [replace(old, K=new.K) for old, new in zip(given, moved, strict=True)]
        cameras = [one if seen else other for one, other, seen in zip(moved, still, known, strict=True)]
        spread = spread_of(cameras, given, known, fitting)
        fine += loss_px == LOSS_PX
        if fine == FINE_ROUNDS:
            break
    return Adjusted(cameras, known, scale - 1.0)


def same_intrinsics(cameras: Sequence[Camera]) -> bool:
    """Whether all have one size and one K."""
    first = cameras[0]
    return all(camera.size == first.size and np.array_equal(camera.K, first.K) for camera in cameras)


def consistent(cameras: Sequence[Camera], tracks: Tracks) -> tuple[Tracks, np.ndarray, float]:
    """The inlier observations of points with enough parallax.

    Returns:
        The tracks, (M, 3) their points, and the scale of errors in pixels, at least `LOSS_PX`.
    """
    xyz = triangulated(cameras, tracks)
    error = reprojection_errors(cameras, xyz, tracks)
    middle = float(np.median(error)) if len(error) else LOSS_PX
    scale = max(LOSS_PX, middle) if np.isfinite(middle) else LOSS_PX
    near = error <= CUT * scale
    tracks = Tracks(tracks.frames, tracks.frame[near], tracks.point[near], tracks.pixel[near])
    long = np.bincount(tracks.point, minlength=len(xyz)) >= MIN_TRACK
    tracks, xyz = some(tracks, long), xyz[long]
    if len(tracks):
        wide = parallax_deg(cameras, xyz, tracks) >= MIN_PARALLAX_DEG
        tracks, xyz = some(tracks, wide), xyz[wide]
    return tracks, xyz, scale


def spread_of(cameras: Sequence[Camera], given: Sequence[Camera], known: np.ndarray, tracks: Tracks) -> Spread:
    """Standard deviations from how far the cameras moved and from the errors that remain."""
    metres, degrees = (float(np.median(way[known])) / MEDIAN_LENGTH for way in moves(cameras, given))
    error = track_errors(cameras, tracks)
    pixels = float(np.nanmedian(error)) / MEDIAN_IN_PLANE
    return Spread(*(max(one, least) for one, least in zip((metres, degrees, pixels), LEAST, strict=True)))


def _groups(tracks: Tracks, count: int) -> np.ndarray:
    """(V,) number of each photo's connected group, -1 in groups of too few photos or tracks."""
    points = int(tracks.point.max()) + 1 if len(tracks) else 0
    seen = np.bincount(tracks.frame, minlength=count)
    graph = coo_array(
        (np.ones(len(tracks), np.int8), (tracks.frame, count + tracks.point)), shape=(count + points, count + points)
    )
    _, component = connected_components(graph, directed=False)
    component = np.where(seen >= LEAST_SEEN, component[:count], -1)
    groups = np.full(count, -1)
    found = 0
    for number in np.unique(component[component >= 0]):
        if np.count_nonzero(component == number) >= LEAST_TOGETHER:
            groups[component == number] = found
            found += 1
    return groups
