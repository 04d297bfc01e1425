"""Depth priors after the joint optimisation, checked against the sparse points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.config import DepthPriorConfig
from room2dgs.logs import Log
from room2dgs.priors.joint.contradicted import contradicted
from room2dgs.priors.joint.optimise import joint_depths


def checked_joint_depths(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    points: PointCloud,
    settings: DepthPriorConfig,
    log: Log,
    confidences: tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]],
    take: Callable[[str, np.ndarray], None],
) -> None:
    """Maps optimised by `joint_depths`, without the pixels that sparse points contradict; residuals are logged.

    Views can agree on a wrong depth: a network that takes blank walls for nearer than they are does so in every photo.
    The sparse points show it, because no smooth log-scale grid fits them then. With too many outliers all maps are
    left out.

    Args:
        confidences: of the depths and of the normals, as in `joint_depths`.
        take: gets each frame's name and map, one after the other; none where all are left out.
    """
    joint = joint_depths(frames, depths, normals, points, settings.manhattan, *confidences)
    (views_before, views_after), (points_before, points_after) = joint.between_views, joint.at_points
    found = []
    if not np.isnan(views_after):
        found.append(f"views differ by {views_after:.1%} ({views_before:.1%} before)")
    if not np.isnan(points_after):
        found.append(f"sparse points by {points_after:.1%} ({points_before:.1%})")
    log(f"joint depth optimisation: {', '.join(found) or 'no two maps overlap'}")
    if joint.outlier_ratio > settings.max_outlier_ratio:
        log(
            f"WARNING: depth prior left out: {joint.outlier_ratio:.0%} of the sparse points are still over 5% off; "
            "use a better network, or prior.depth.max_outlier_ratio=1 to use the maps as they are"
        )
        return
    _without_contradicted(frames, joint.depths, points, log, take)


def _without_contradicted(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    points: PointCloud,
    log: Log,
    take: Callable[[str, np.ndarray], None],
) -> None:
    before, after = 0, 0
    for frame in frames:
        if frame.name in depths:
            depth = depths[frame.name]
            checked = np.where(contradicted(depth, seen_points(points, frame)), np.float32(0), depth)
            before += np.count_nonzero(depth)
            after += np.count_nonzero(checked)
            take(frame.name, checked)
    if after < before:
        log(f"depth prior: {1 - after / before:.0%} of its pixels left out, where sparse points contradict it")
