"""`render`: surfels and a camera to images, by the kernels of the tensors' device."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.cuda_extension import cuda_extension
from room2dgs.geometry.camera import NEAR_M
from room2dgs.kernels.builds import BLOCK_BUILDS
from room2dgs.splat.checks import check_floor, check_near, check_shapes, switch
from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.splat.operators import Rasterize
from room2dgs.splat.types import Rendering, Surfels


def render(
    surfels: Surfels,
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
) -> Rendering:
    """Render one view.

    Differentiable once with respect to every tensor of `surfels`, to `K` (its fx, fy, cx, cy), `cam_from_world` and
    `background`. The same inputs give the same bits on any number of threads. `torch.compile` takes it as one
    operator, without a graph break.

    Args:
        surfels: see `Surfels`; float32 for the compiled kernels.
        K: (3, 3) intrinsics in pixels, centres at +0.5; focal lengths above 0, no skew, last row 0 0 1.
        cam_from_world: (4, 4) rigid pose, metres.
        width, height: image size in pixels, 1..16384.
        background: (3,) RGB, black by default.
        near_m: surfels with centres nearer than this, and parts of discs that are, are not drawn; above 0.
        opacity_floor: hits fainter than this are skipped, 1/255 to below 1; the higher, the fewer pixels a disc has.
        center_px: (N, 2) zeros that require grad: their gradient is that of the projected centres, in 1/pixel.
        with_normal, with_distortion: leave out an output that is not wanted (it is zeros then).

    Returns:
        `Rendering`.

    Raises:
        TypeError: lists or arrays where tensors belong.
        ValueError: shapes, types, sizes or values that do not fit, or no kernels for them.
    """
    check_shapes(surfels, K, cam_from_world, width, height, background, center_px)
    check_near(near_m)
    check_floor(opacity_floor)
    check_kernels(surfels.centers)
    with_normal, with_distortion = switch("with_normal", with_normal), switch("with_distortion", with_distortion)
    if background is None:
        background = torch.zeros(3, dtype=torch.float32, device=surfels.centers.device)
    *images, _ = Rasterize.apply(
        *surfels, cam_from_world, K, background, center_px,
        width, height, near_m, opacity_floor, with_normal, with_distortion,
    )  # fmt: skip
    return Rendering(*images)


def check_kernels(like: Tensor, called: str = "surfels", reference: str = "splat.reference.render") -> None:
    """Kernels for splats of this type on this device.

    Args:
        called: what an error's sentence calls them.
        reference: what takes any type.

    Raises:
        ValueError: there are none; says what to do.
    """
    device = like.device.type
    if device == "cuda" and (missing := cuda_extension().missing):
        raise ValueError(missing)
    if device != "cpu" and device not in BLOCK_BUILDS:
        raise ValueError(f"no rasterizer for tensors on {device}; move them to the CPU")
    if like.dtype != torch.float32:
        raise ValueError(
            f"the {called} are {like.dtype}; the rasterizer takes torch.float32 ({reference} takes any type)"
        )
