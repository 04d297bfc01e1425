"""The photometric loss: L1 and structural dissimilarity."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.block_code import build_for
from room2dgs.geometry.arguments import number
from room2dgs.geometry.kernel_arguments import runs_compiled
from room2dgs.kernel_calls import call
from room2dgs.losses import blocks, reference
from room2dgs.losses.checks import check_images
from room2dgs.losses.known_gradients import with_gradients


def rgb_loss(rendered: Tensor, target: Tensor, dssim: float) -> Tensor:
    """L_rgb = (1 - dssim) mean |rendered - target| + dssim (1 - mean SSIM), as 2DGS has it.

    SSIM has an 11 x 11 Gaussian window of sigma 1.5, C1 = 0.01^2, C2 = 0.03^2, zeros outside the image, and
    is averaged over pixels and channels. float32 on the CPU takes the compiled kernel, which computes value
    and gradient in one sweep and gives the same bits on any number of threads. The gradient of |.| at 0 is 0.

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
    if dssim and build_for(rendered, target):
        return blocks.rgb_loss(rendered, target, dssim)
    if dssim == 0 or not runs_compiled(rendered, target):
        return reference.rgb_loss(rendered, target.detach(), dssim) if dssim else (rendered - target).abs().mean()
    gradient = torch.empty(rendered.shape, dtype=torch.float32) if rendered.requires_grad else None
    l1, dissimilarity = call(_C.rgb_loss, rendered.detach().contiguous(), target.detach().contiguous(), dssim, gradient)
    value = rendered.new_tensor((1 - dssim) * l1 + dssim * dissimilarity)
    return value if gradient is None else with_gradients(value, [rendered], [gradient])
