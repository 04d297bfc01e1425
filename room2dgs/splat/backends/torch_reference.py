"""The readable reference (`splat.reference`) as a backend: any floating type and device, slow, exact in float64."""

from __future__ import annotations

import torch

from room2dgs.splat import reference
from room2dgs.splat.backends.backend import Backend, View
from room2dgs.splat.checks import check_center_px, check_values
from room2dgs.splat.types import Rendering, Surfels


def render(surfels: Surfels, view: View) -> Rendering:
    """One view by `reference.render`, with the same outputs left out as the compiled kernels do."""
    check_values(view.K, view.cam_from_world, view.background, view.near_m, view.opacity_floor)
    check_center_px(view.center_px)
    K, pose, background = (x.to(surfels.centers.dtype) for x in (view.K, view.cam_from_world, view.background))
    rendering = reference.render(
        surfels, K, pose, view.width, view.height,
        background=background, near_m=view.near_m, opacity_floor=view.opacity_floor, center_px=view.center_px,
    )  # fmt: skip
    if not view.with_normal:
        rendering = rendering._replace(normal=torch.zeros_like(rendering.normal))
    if not view.with_distortion:
        rendering = rendering._replace(distortion=torch.zeros_like(rendering.distortion))
    return rendering


BACKEND = Backend("reference", None, None, render, automatic=False)
