"""Depth and normal priors: maps of each photo, aligned to the scene."""

from room2dgs.depth.estimate import StereoViews, estimate_depth
from room2dgs.depth.load import Priors, load_priors

__all__ = ["Priors", "StereoViews", "estimate_depth", "load_priors"]
