"""Depth and normal priors: maps of each photo, aligned to the scene."""

from room2dgs.depth.load import Priors, load_priors

__all__ = ["Priors", "load_priors"]
