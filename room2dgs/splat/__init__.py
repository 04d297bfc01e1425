"""The differentiable rasterizer of 2D Gaussian surfels and of 3D Gaussians."""

from room2dgs.splat.api import render
from room2dgs.splat.gaussians.api import render as render_gaussians
from room2dgs.splat.gaussians.gsplat import rasterization
from room2dgs.splat.gsplat_2dgs import rasterization_2dgs
from room2dgs.splat.threads import set_threads
from room2dgs.splat.types import Gaussians, Rendering, Surfels

__all__ = [
    "Gaussians",
    "Rendering",
    "Surfels",
    "rasterization",
    "rasterization_2dgs",
    "render",
    "render_gaussians",
    "set_threads",
]
