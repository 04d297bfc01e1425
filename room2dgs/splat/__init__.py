"""The differentiable rasterizer of 2D Gaussian surfels."""

from room2dgs.splat.raster import render, set_threads
from room2dgs.splat.types import Rendering, Surfels

__all__ = ["Rendering", "Surfels", "render", "set_threads"]
