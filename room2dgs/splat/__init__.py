"""The differentiable rasterizer of 2D Gaussian surfels."""

from room2dgs.splat.api import render
from room2dgs.splat.rasterization import rasterization_2dgs
from room2dgs.splat.threads import set_threads
from room2dgs.splat.types import Rendering, Surfels

__all__ = ["Rendering", "Surfels", "rasterization_2dgs", "render", "set_threads"]
