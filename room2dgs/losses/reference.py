"""The losses in plain torch: any dtype, differentiable by autograd; in float64 the oracle of the kernels."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs.geometry.depth_points import normals_by_differences

WINDOW = 11
SIGMA = 1.5
C1 = 0.01**2
C2 = 0.03**2


def ssim(rendered: Tensor, target: Tensor) -> Tensor:
    """Structural similarity (Wang et al. 2004) as 3DGS and 2DGS use it, at every pixel and channel.

    An 11 x 11 Gaussian window of sigma 1.5, colours in 0..1, zeros outside the image.

    Args:
        rendered, target: (H, W, 3).

    Returns:
        (H, W, 3), 1 where the images agree.
    """
    offsets = torch.arange(WINDOW, dtype=rendered.dtype) - WINDOW // 2
    window = torch.exp(-(offsets**2) / (2 * SIGMA**2))
    window = window / window.sum()
    kernel = (window[:, None] * window[None, :])[None, None]

    def mean(image: Tensor) -> Tensor:
        planes = image.permute(2, 0, 1)[:, None]
        return torch.nn.functional.conv2d(planes, kernel, padding=WINDOW // 2)[:, 0].permute(1, 2, 0)

    mean_x, mean_y = mean(rendered), mean(target)
    var_x = mean(rendered * rendered) - mean_x * mean_x
    var_y = mean(target * target) - mean_y * mean_y
    covariance = mean(rendered * target) - mean_x * mean_y
    return ((2 * mean_x * mean_y + C1) * (2 * covariance + C2)) / (
        (mean_x * mean_x + mean_y * mean_y + C1) * (var_x + var_y + C2)
    )


def rgb_loss(rendered: Tensor, target: Tensor, dssim: float) -> Tensor:
    """(1 - dssim) mean |rendered - target| + dssim (1 - mean SSIM); see `photometric.rgb_loss`."""
    l1 = (rendered - target).abs().mean()
    return (1 - dssim) * l1 + dssim * (1 - ssim(rendered, target).mean())


def normal_consistency(
    depth: Tensor, alpha: Tensor, normal: Tensor, K: Tensor | np.ndarray, cam_from_world: Tensor | np.ndarray
) -> Tensor:
    """See `surface.normal_consistency`, with the rendering's maps one by one."""
    surface, valid = normals_by_differences(depth, K, cam_from_world)
    alpha = alpha.detach()
    term = alpha * (alpha - (normal * surface).sum(-1))
    return torch.where(valid, term, torch.zeros_like(term)).mean()
