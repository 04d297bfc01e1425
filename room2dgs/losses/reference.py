"""The losses in plain torch: any dtype, differentiable by autograd; in float64 the oracle of the kernels."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs.geometry.depth_maps import normals_by_differences
from room2dgs.geometry.similarity import ssim


def rgb_loss(rendered: Tensor, target: Tensor, dssim: float) -> Tensor:
    """(1 - dssim) mean |rendered - target| + dssim (1 - mean SSIM); see `photometric.rgb_loss`."""
    l1 = (rendered - target).abs().mean()
    return (1 - dssim) * l1 + dssim * (1 - ssim(rendered, target, border="zeros").mean())


def normal_consistency(
    depth: Tensor, alpha: Tensor, normal: Tensor, K: Tensor | np.ndarray, cam_from_world: Tensor | np.ndarray
) -> Tensor:
    """See `surface.normal_consistency`, with the rendering's maps one by one."""
    surface, valid = normals_by_differences(depth, K, cam_from_world)
    alpha = alpha.detach()
    term = alpha * (alpha - (normal * surface).sum(-1))
    return torch.where(valid, term, torch.zeros_like(term)).mean()
