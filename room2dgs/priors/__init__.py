"""Depth and normal priors: maps of each photo, aligned to the scene."""

from room2dgs.priors.load import Priors, load_priors
from room2dgs.priors.prior import Prior

__all__ = ["Prior", "Priors", "load_priors"]
