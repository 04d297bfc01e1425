"""The differentiable rasterizer of 2D Gaussian surfels."""

from room2dgs.splat.raster import available_cores, render, set_threads
from room2dgs.splat.types import Rendering, Surfels

__all__ = ["Rendering", "Surfels", "available_cores", "render", "set_threads"]
