"""Depth and normals of each photo before training: proposed, compared, aligned, optimised, completed, corrected.

`stages.py` is the method, `estimate.py` its entry.
"""

from room2dgs.depth.estimate import Priors, StereoViews, depth_of_frames, estimate_depth

__all__ = ["Priors", "StereoViews", "depth_of_frames", "estimate_depth"]
