"""Losses: each a pure function of a rendering and what it should be."""

from room2dgs.losses.compared_pixels import multiview_losses
from room2dgs.losses.depth_prior import depth_prior_loss, edge_band
from room2dgs.losses.multiview import multiview_geometric, multiview_photometric
from room2dgs.losses.normal_prior import normal_prior_loss
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import distortion, normal_consistency

__all__ = [
    "depth_prior_loss",
    "distortion",
    "edge_band",
    "multiview_geometric",
    "multiview_losses",
    "multiview_photometric",
    "normal_consistency",
    "normal_prior_loss",
    "rgb_loss",
]
