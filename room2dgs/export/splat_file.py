"""`.splat`: 32 bytes a Gaussian, no header, no view-dependent colour; what web viewers stream."""

from __future__ import annotations

import numpy as np

from room2dgs.export.gaussian_ply import FLAT
from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.splat.types import Surfels

RECORD = np.dtype([("center", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("wxyz", "u1", 4)])


def splat_bytes(surfels: Surfels) -> bytes:
    """A whole file; what covers most comes first, so that a part of it shows the room already."""
    scales, opacities = surfels.scales.numpy(), surfels.opacities.numpy()
    order = np.argsort(-(scales.prod(axis=1) * opacities), kind="stable")
    records = np.zeros(len(order), RECORD)
    records["center"] = surfels.centers.numpy()[order]
    records["scale"][:, :2] = scales[order]
    records["scale"][:, 2] = FLAT
    color = 0.5 + C0 * surfels.sh[:, 0].numpy()[order]
    records["rgba"][:, :3] = _byte(color * 255)
    records["rgba"][:, 3] = _byte(opacities[order] * 255)
    quaternions = surfels.rotations.double().numpy()[order]
    quaternions = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    records["wxyz"] = _byte(quaternions * 128 + 128)
    return records.tobytes()


def _byte(values: np.ndarray) -> np.ndarray:
    return np.round(values).clip(0, 255).astype(np.uint8)
