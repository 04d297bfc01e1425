"""Depth priors after the joint optimisation, and what it changed, in the log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.depth.joint.optimise import joint_depths
from room2dgs.logs import Log


def logged_joint_depths(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    points: PointCloud,
    manhattan: bool,
    log: Log,
    confidences: tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]],
) -> Mapping[str, np.ndarray]:
    """Maps optimised by `joint_depths`; residuals before and after are logged.

    Args:
        confidences: of the depths and of the normals, as in `joint_depths`.
    """
    joint = joint_depths(frames, depths, normals, points, manhattan, *confidences)
    (views_before, views_after), (points_before, points_after) = joint.between_views, joint.at_points
    found = []
    if not np.isnan(views_after):
        found.append(f"views differ by {views_after:.1%} ({views_before:.1%} before)")
    if not np.isnan(points_after):
        found.append(
            f"points by {points_after:.1%} ({points_before:.1%}), {joint.outlier_ratio:.0%} of them by more than 5%"
        )
    log(f"joint depth optimisation: {', '.join(found) or 'no two maps overlap'}")
    return joint.depths
