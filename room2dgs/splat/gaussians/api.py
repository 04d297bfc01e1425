"""`render`: 3D Gaussians and a camera to images."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.geometry.camera import NEAR_M
from room2dgs.splat.api import check_kernels
from room2dgs.splat.checks import check_filter, check_floor, check_near, check_shapes, switch
from room2dgs.splat.constants import GAUSSIAN_FILTER_PX2, MIP_FILTER_PX2, OPACITY_FLOOR
from room2dgs.splat.gaussians.operators import Rasterize
from room2dgs.splat.types import Gaussians, Rendering


def render(
    gaussians: Gaussians,
    K: Tensor,
    cam_from_world: Tensor,
    width: int,
    height: int,
    *,
    background: Tensor | None = None,
    near_m: float = NEAR_M,
    opacity_floor: float = OPACITY_FLOOR,
    center_px: Tensor | None = None,
    with_normal: bool = True,
    with_distortion: bool = True,
    antialias: bool = False,
    filter_px2: float | None = None,
) -> Rendering:
    """Render one view; arguments, outputs and promises are those of `splat.render`.

    Each Gaussian is an ellipse on the screen (EWA, as in 3DGS), blended in the order of its centre's depth. Depth is
    where the Gaussian is densest along the pixel's ray (RaDe-GS), and the normal is that of the plane on which this
    lies: for a flat Gaussian its own.

    Args:
        gaussians: see `Gaussians`; float32.
        antialias: opacity is lowered by what the pixel's filter adds to the ellipse's area (Mip-Splatting).
        filter_px2: variance of the pixel's filter, 0.01 to 1 px^2; None: 0.3 (3DGS), with `antialias` 0.1.

    Raises:
        TypeError: lists or arrays where tensors belong.
        ValueError: shapes, types, sizes or values that do not fit, or no kernels for them.
    """
    check_shapes(gaussians, K, cam_from_world, width, height, background, center_px)
    check_near(near_m)
    check_floor(opacity_floor)
    check_kernels(gaussians.centers, "Gaussians", "splat.gaussians.reference.render")
    with_normal, with_distortion = switch("with_normal", with_normal), switch("with_distortion", with_distortion)
    antialias = switch("antialias", antialias)
    if filter_px2 is None:
        filter_px2 = MIP_FILTER_PX2 if antialias else GAUSSIAN_FILTER_PX2
    check_filter("filter_px2", filter_px2)
    if background is None:
        background = torch.zeros(3, dtype=torch.float32, device=gaussians.centers.device)
    *images, _ = Rasterize.apply(
        *gaussians, cam_from_world, K, background, center_px,
        width, height, near_m, opacity_floor, with_normal, with_distortion, filter_px2, antialias,
    )  # fmt: skip
    return Rendering(*images)
