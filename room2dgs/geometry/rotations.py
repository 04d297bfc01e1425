"""Axes of surfels from their quaternions."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import normalize


def tangents(rotations: Tensor) -> Tensor:
    """(N, 4) quaternions (w, x, y, z) of any norm to (N, 2, 3): t_u and t_v, unit, world frame."""
    w, x, y, z = normalize(rotations, dim=1).unbind(1)
    t_u = torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], dim=1)
    t_v = torch.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], dim=1)
    return torch.stack([t_u, t_v], dim=1)


def normals(rotations: Tensor) -> Tensor:
    """(N, 4) quaternions (w, x, y, z) of any norm to (N, 3): t_w, unit, world frame, on either side."""
    w, x, y, z = normalize(rotations, dim=1).unbind(1)
    return torch.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], dim=1)
