"""Real spherical harmonics up to degree 3, in the order and signs that splat files use."""

from __future__ import annotations

import torch
from torch import Tensor

C0 = 0.28209479177387814
C1 = 0.4886025119029199
C2 = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396)
C3 = (
    -0.5900435899266435,
    2.890611442640554,
    -0.4570457994644658,
    0.3731763325901154,
    -0.4570457994644658,
    1.445305721320277,
    -0.5900435899266435,
)


def sh_basis(directions: Tensor, count: int) -> Tensor:
    """Basis values.

    Args:
        directions: (N, 3) unit vectors.
        count: 1, 4, 9 or 16 functions.

    Returns:
        (N, count).
    """
    x, y, z = directions.unbind(-1)
    terms = [torch.full_like(x, C0)]
    if count > 1:
        terms += [-C1 * y, C1 * z, -C1 * x]
    if count > 4:
        xx, yy, zz, xy, yz, xz = x * x, y * y, z * z, x * y, y * z, x * z
        terms += [C2[0] * xy, C2[1] * yz, C2[2] * (2 * zz - xx - yy), C2[3] * xz, C2[4] * (xx - yy)]
    if count > 9:
        terms += [
            C3[0] * y * (3 * xx - yy),
            C3[1] * xy * z,
            C3[2] * y * (4 * zz - xx - yy),
            C3[3] * z * (2 * zz - 3 * xx - 3 * yy),
            C3[4] * x * (4 * zz - xx - yy),
            C3[5] * z * (xx - yy),
            C3[6] * x * (xx - 3 * yy),
        ]
    return torch.stack(terms, dim=-1)


def sh_color(sh: Tensor, directions: Tensor) -> Tensor:
    """Colour seen along `directions` (camera to surfel): 0.5 + sum_k Y_k sh_k, clamped below at 0.

    Args:
        sh: (N, K, 3).
        directions: (N, 3) unit vectors, world frame.

    Returns:
        (N, 3).
    """
    basis = sh_basis(directions, sh.shape[1])
    return (0.5 + (basis.unsqueeze(-1) * sh).sum(dim=1)).clamp_min(0.0)
