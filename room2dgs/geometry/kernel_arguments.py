"""Cameras and maps as the compiled kernels take them."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor


def runs_compiled(*maps: Tensor) -> bool:
    """True if the compiled kernels take these tensors."""
    return all(m.dtype == torch.float32 and m.device.type == "cpu" for m in maps)


def intrinsics(K: Tensor | np.ndarray) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of a (3, 3) matrix without skew, pixels."""
    return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])


def rotation_of(cam_from_world: Tensor | np.ndarray) -> np.ndarray:
    """(3, 3) float64, contiguous, detached."""
    pose = cam_from_world.detach().cpu().numpy() if isinstance(cam_from_world, Tensor) else cam_from_world
    return np.ascontiguousarray(pose[:3, :3], dtype=np.float64)
