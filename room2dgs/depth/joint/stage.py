"""Joint optimisation as a stage, and what it changed, in the log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from room2dgs.depth.joint.optimise import joint_depths
from room2dgs.depth.state import DepthSettings, DepthState


def optimise_jointly(state: DepthState, settings: DepthSettings) -> DepthState:
    """Bend all depth maps until views, samples and normals agree; differences before and after are logged."""
    if not (state.depth_settings.joint and state.depths and len(state.samples)):
        return state
    with settings.timed("joint"):
        joint = joint_depths(
            state.frames,
            state.depths,
            state.normals,
            state.samples,
            state.depth_settings.manhattan,
            state.depth_weights(),
            state.normal_weights,
        )
    (views_before, views_after), (points_before, points_after) = joint.between_views, joint.at_points
    found = []
    if not np.isnan(views_after):
        found.append(f"views differ by {views_after:.1%} ({views_before:.1%} before)")
    if not np.isnan(points_after):
        found.append(
            f"points by {points_after:.1%} ({points_before:.1%}), {joint.outlier_ratio:.0%} of them by more than 5%"
        )
    settings.log(f"joint depth optimisation: {', '.join(found) or 'no two maps overlap'}")
    return replace(state, depths=joint.depths)
