"""Losses: each a pure function of a rendering and what it should be."""

from room2dgs.losses.geometry import depth_to_normals, depth_to_points
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import distortion, normal_consistency

__all__ = ["depth_to_normals", "depth_to_points", "distortion", "normal_consistency", "rgb_loss"]
