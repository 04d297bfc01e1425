"""Plain tensors in, plain tensors out: what the rasterizer takes and gives."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.splat.constants import MIN_COVERED_ALPHA


class Surfels(NamedTuple):
    """2D Gaussian discs in the world frame (eq. 1), activated: metres and probabilities, not logits.

    Values are not checked when surfels are drawn, which would cost as much as drawing: a surfel whose centre,
    rotation, scale or opacity is NaN is not drawn, and NaN among its `sh` counts as black.

    Attributes:
        centers: (N, 3) metres.
        rotations: (N, 4) quaternions (w, x, y, z), normalised inside; the matrix's columns are t_u, t_v, t_w.
        scales: (N, 2) s_u, s_v > 0, metres.
        opacities: (N,) in (0, 1).
        sh: (N, K, 3) spherical-harmonics coefficients, K in {1, 4, 9, 16}; colour = 0.5 + sum_k Y_k(dir) sh_k,
            clamped below at 0.
    """

    centers: Tensor
    rotations: Tensor
    scales: Tensor
    opacities: Tensor
    sh: Tensor

    def __repr__(self) -> str:
        """How many, where, and how fine their colours are; the numbers themselves are tensors enough."""
        count, degree = len(self.centers), math.isqrt(self.sh.shape[1]) - 1
        known = self.centers[self.centers.isfinite().all(dim=1)]
        if not len(known):
            return f"Surfels({count:,})"
        low, high = (", ".join(f"{value:.2f}" for value in end.tolist()) for end in (known.amin(0), known.amax(0)))
        return f"Surfels({count:,}, from ({low}) to ({high}) m, colours of degree {degree})"


class Gaussians(NamedTuple):
    """3D Gaussians in the world frame, activated; what `Surfels` says of values and NaN holds for them.

    Attributes:
        centers: (N, 3) metres.
        rotations: (N, 4) quaternions (w, x, y, z), normalised inside; the matrix's columns are the axes.
        scales: (N, 3) standard deviations > 0 along the axes, metres.
        opacities: (N,) in (0, 1).
        sh: (N, K, 3) spherical-harmonics coefficients as surfels have them.
    """

    centers: Tensor
    rotations: Tensor
    scales: Tensor
    opacities: Tensor
    sh: Tensor


class Rendering(NamedTuple):
    """One view. With w_i = T_i alpha_i the weight of the i-th surfel along the pixel's ray:

    Attributes:
        color: (H, W, 3) sum w_i c_i + T_end background.
        alpha: (H, W) sum w_i.
        depth: (H, W) expected z-depth sum w_i z_i / sum w_i, metres; 0 where alpha is 0.
        median_depth: (H, W) z-depth of the surfel at which the transmittance falls to 0.5 or less; 0 if it never does.
        normal: (H, W, 3) sum w_i n_i, world frame, each n_i unit and facing the camera; not normalised.
        distortion: (H, W) sum_{i>j} w_i w_j (m_i - m_j)^2 with m = far/(far-near) (1 - near/z),
            near 0.2 m, far 100 m (2DGS).
    """

    color: Tensor
    alpha: Tensor
    depth: Tensor
    median_depth: Tensor
    normal: Tensor
    distortion: Tensor

    @property
    def covered(self) -> Tensor:
        """(H, W) bool: the pixels whose depth and normal are worth using."""
        return self.alpha >= MIN_COVERED_ALPHA

    def covered_depth(self) -> Tensor:
        """(H, W) median z-depth, metres; 0 where a pixel is not covered."""
        return torch.where(self.covered, self.median_depth, 0.0)
