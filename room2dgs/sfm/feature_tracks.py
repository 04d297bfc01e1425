"""Tracks from matches alone, without poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from room2dgs.captures.point_cloud import Tracks
from room2dgs.colmap import pycolmap
from room2dgs.cores import available_cores
from room2dgs.geometry.camera import Camera
from room2dgs.parallel_map import parallel_map
from room2dgs.sfm.matching import IndexPairs, Matches, epipolar_error, essential_inliers

RANSAC_PX = 2.0
TRIALS, CONFIDENCE = (20, 1000), 0.999  # more find less than a hundredth more tracks and take several times as long
MIN_PAIR_INLIERS = 15
# A pair whose own geometry lies further from the given poses than they can be wrong has matched a look-alike.
LARGEST_POSE_ERROR_DEG = 6.0
HELD_OUT = 5  # every so manieth track judges and takes no part
MIN_TRACK = 3  # with two photos an error along the epipolar line goes into the depth, unseen


@dataclass(frozen=True)
class FeatureTracks:
    """Tracks, and which feature of which photo each observation is.

    Attributes:
        tracks: observations sorted by point.
        feature: (O,) int64, index among the features of the photo.
    """

    tracks: Tracks
    feature: np.ndarray


def feature_tracks(matches: Matches, cameras: Sequence[Camera], pairs: IndexPairs) -> FeatureTracks:
    """Features joined along the matches that fit a relative pose found by RANSAC.

    Those of 3 photos or more count, and never two features of one photo.

    Args:
        cameras: of the first photos of `matches`, with poses to 6 degrees.
        pairs: of these photos.
    """
    counts = [len(keypoints) for keypoints in matches.keypoints[: len(cameras)]]
    first = np.concatenate([[0], np.cumsum(counts)])

    def inliers_of(pair: tuple[int, int]) -> np.ndarray:
        return pair_inliers(matches, pair, cameras[pair[0]], cameras[pair[1]])

    found = list(parallel_map(inliers_of, pairs, available_cores()))
    links = [first[list(pair)] + inliers for pair, inliers in zip(pairs, found, strict=True)]
    link = np.concatenate(links) if links else np.zeros((0, 2), np.int64)
    graph = coo_array((np.ones(len(link), np.int8), (link[:, 0], link[:, 1])), shape=(first[-1], first[-1]))
    _, component = connected_components(graph, directed=False)
    frame = np.repeat(np.arange(len(counts)), counts)
    size = np.bincount(component)
    photos = np.bincount(np.unique(np.stack([component, frame]), axis=1)[0], minlength=len(size))
    chosen = (size >= MIN_TRACK) & (photos == size)
    node = np.flatnonzero(chosen[component])
    node = node[np.argsort(component[node], kind="stable")]
    _, point = np.unique(component[node], return_inverse=True)
    feature = node - first[frame[node]]
    pixel = np.concatenate([np.zeros((0, 2)), *matches.keypoints[: len(cameras)]])[node]
    names = tuple(frame.name for frame in matches.frames[: len(cameras)])
    tracks = Tracks(names, frame[node].astype(np.int32), point.astype(np.int32), pixel.astype(np.float32))
    return FeatureTracks(tracks, feature)


def pair_inliers(matches: Matches, pair: tuple[int, int], first: Camera, second: Camera) -> np.ndarray:
    """(M, 2) int64 inliers of the pair's own relative pose; none where it is far from the given cameras'."""
    none = np.zeros((0, 2), np.int64)
    if len(matches.of_pair.get(pair, none)) < MIN_PAIR_INLIERS:
        return none
    of_pair, (first_px, second_px) = matches.of_pair[pair], matches.pixels(pair)
    options = pycolmap.RANSACOptions(
        max_error=RANSAC_PX,
        min_num_trials=TRIALS[0],
        max_num_trials=TRIALS[1],
        confidence=CONFIDENCE,
        random_seed=0,
    )
    own = essential_inliers(first, second, first_px, second_px, options)
    if np.count_nonzero(own) < MIN_PAIR_INLIERS:
        return none
    largest_px = np.tan(np.radians(LARGEST_POSE_ERROR_DEG)) * first.K[0, 0]
    near = np.median(epipolar_error(first, second, first_px[own], second_px[own])) <= largest_px
    return of_pair[own].astype(np.int64) if near else none


def covering(tracks: Tracks, wanted: int) -> np.ndarray:
    """(M,) bool: the longest tracks, enough to give each photo `wanted` observations."""
    length = np.bincount(tracks.point)
    start = np.concatenate([[0], np.cumsum(length)])
    have = np.zeros(len(tracks.frames), np.int64)
    chosen = np.zeros(len(length), bool)
    for point in np.argsort(-length, kind="stable"):
        seen = tracks.frame[start[point] : start[point + 1]]
        if (have[seen] < wanted).any():
            have[seen] += 1
            chosen[point] = True
    return chosen


def some(tracks: Tracks, which: np.ndarray) -> Tracks:
    """The tracks of some points, which are numbered anew.

    Args:
        which: (M,) bool.
    """
    kept = which[tracks.point]
    point = (np.cumsum(which) - 1)[tracks.point[kept]].astype(np.int32)
    return Tracks(tracks.frames, tracks.frame[kept], point, tracks.pixel[kept])


def judges_and_used(tracks: Tracks) -> tuple[Tracks, Tracks]:
    """Held-out tracks that an adjustment is judged by, every fifth one, and the others, which it uses."""
    held_out = np.arange(int(tracks.point.max()) + 1) % HELD_OUT == 0
    return some(tracks, held_out), some(tracks, ~held_out)
