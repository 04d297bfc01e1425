"""The photometric loss: L1 and structural dissimilarity."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.geometry.arguments import number
from room2dgs.kernels.builds import Build
from room2dgs.kernels.calls import call
from room2dgs.kernels.operators import has_kernels, operator
from room2dgs.losses import reference
from room2dgs.losses.block_losses import empty_like, empty_sums, losses_of, plain
from room2dgs.losses.checks import check_images
from room2dgs.losses.known_gradients import with_gradients


def rgb_loss(rendered: Tensor, target: Tensor, dssim: float) -> Tensor:
    """L_rgb = (1 - dssim) mean |rendered - target| + dssim (1 - mean SSIM), as 2DGS has it.

    SSIM has an 11 x 11 Gaussian window of sigma 1.5, C1 = 0.01^2, C2 = 0.03^2, zeros outside the image, and is
    averaged over pixels and channels. float32 takes compiled kernels, which compute value and gradient in one sweep
    and give the same bits on any number of threads. The gradient of |.| at 0 is 0.

    Args:
        rendered: (H, W, 3) colours in 0..1.
        target: (H, W, 3), the photo; no gradient flows to it.
        dssim: weight of the dissimilarity, in [0, 1].

    Returns:
        scalar, differentiable once with respect to `rendered`.

    Raises:
        TypeError: an image is no tensor in floating point: levels of 0..255 are not meant.
        ValueError: the images differ in size or are empty; a weight that is none.
    """
    check_images(3, rendered=rendered, target=target)
    if not 0 <= number("dssim", dssim) <= 1:
        raise ValueError(f"dssim is {dssim}; it is to be from 0 to 1")
    if rendered.shape != target.shape:
        raise ValueError(f"rendered {tuple(rendered.shape)} and target {tuple(target.shape)} differ in size")
    if dssim == 0:
        return (rendered - target).abs().mean()
    if not has_kernels(rendered, target):
        return reference.rgb_loss(rendered, target.detach(), dssim)
    value, gradient = RGB_LOSS(rendered, target, dssim, rendered.requires_grad)
    return with_gradients(value, [rendered], [gradient]) if rendered.requires_grad else value


def _on_cpu(rendered: Tensor, target: Tensor, dssim: float, with_gradient: bool) -> tuple[Tensor, Tensor]:
    gradient = empty_like(rendered) if with_gradient else None
    l1, dissimilarity = call(_C.rgb_loss, plain(rendered), plain(target), dssim, gradient)
    return rendered.new_tensor((1 - dssim) * l1 + dssim * dissimilarity), _or_empty(gradient, rendered)


def _by_block_code(
    build: Build, rendered: Tensor, target: Tensor, dssim: float, with_gradient: bool
) -> tuple[Tensor, Tensor]:
    losses, queue = losses_of(build, rendered)
    gradient = empty_like(rendered) if with_gradient else None
    values = empty_sums(rendered, 2)
    call(losses.rgb_loss, plain(rendered), plain(target), dssim, values, gradient, queue)
    l1, dissimilarity = values
    return torch.lerp(l1, dissimilarity, float(dssim)).to(rendered.dtype), _or_empty(gradient, rendered)


def _or_empty(gradient: Tensor | None, like: Tensor) -> Tensor:
    return like.new_empty(0) if gradient is None else gradient


RGB_LOSS = operator(
    "rgb_loss(Tensor rendered, Tensor target, float dssim, bool with_gradient) -> (Tensor, Tensor)",
    _by_block_code,
    _on_cpu,
)
