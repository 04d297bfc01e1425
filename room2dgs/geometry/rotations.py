"""Quaternions (w, x, y, z), rotation matrices and the axes of surfels: t_u, t_v, t_w are a matrix's columns."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor
from torch.nn.functional import normalize


def rotation_matrices(quaternions: Tensor) -> Tensor:
    """Rotation matrices; differentiable.

    Args:
        quaternions: (N, 4) (w, x, y, z) of any norm > 0; 0 counts as no rotation.

    Returns:
        (N, 3, 3) with columns t_u, t_v, t_w.
    """
    tiny = torch.finfo(quaternions.dtype).tiny
    w, x, y, z = normalize(quaternions, dim=-1, eps=tiny).unbind(-1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(rows, dim=-1).reshape(-1, 3, 3)


def tangents(quaternions: Tensor) -> Tensor:
    """(N, 4) quaternions to (N, 2, 3): t_u and t_v, unit, world frame."""
    return rotation_matrices(quaternions)[:, :, :2].transpose(1, 2)


def normals(quaternions: Tensor) -> Tensor:
    """(N, 4) quaternions to (N, 3): t_w, unit, world frame, on either side."""
    return rotation_matrices(quaternions)[:, :, 2]


def quaternions_from(matrices: np.ndarray) -> np.ndarray:
    """(N, 3, 3) rotation matrices to (N, 4) float64 unit quaternions (w, x, y, z), w >= 0."""
    return Rotation.from_matrix(matrices).as_quat(canonical=True, scalar_first=True)


def quaternions_to(normals: np.ndarray) -> np.ndarray:
    """Shortest rotations that take the z axis to each normal.

    Args:
        normals: (N, 3) unit.

    Returns:
        (N, 4) float64 unit quaternions (w, x, y, z).
    """
    x, y, z = normals.T
    # 1 + z without cancellation near the far pole
    above = np.where(z < 0, (x * x + y * y) / (1.0 - np.minimum(z, 0.0)), 1.0 + z)
    quaternions = np.stack([above, -y, x, np.zeros_like(z)], axis=1)
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    # exactly -z: half a turn about x
    return np.where(length > 0, quaternions / np.where(length > 0, length, 1.0), [0.0, 1.0, 0.0, 0.0])


def across_of(normal: np.ndarray) -> np.ndarray:
    """(2, 3) unit, at right angles with a (3,) unit vector and each other."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])
