"""`.splat`: 32 bytes a Gaussian, no header, no view-dependent colour; what web viewers stream."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.export.local_files import write_local
from room2dgs.export.source import Source
from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.primitives.primitive import Splats
from room2dgs.primitives.registry import primitive_of

RECORD = np.dtype([("center", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("wxyz", "u1", 4)])


def write_splat(source: Source, path: Path) -> list[Path]:
    """With y down."""
    return write_local(source, path, splat_bytes(source.surfels_y_down), source.y_down)


def splat_bytes(splats: Splats) -> bytes:
    """A whole file; what covers most comes first, so that a part of it shows the room already."""
    scales, opacities = splats.scales.numpy(), splats.opacities.numpy()
    order = np.argsort(-(scales.prod(axis=1) * opacities), kind="stable")
    records = np.zeros(len(order), RECORD)
    records["center"] = splats.centers.numpy()[order]
    records["scale"] = primitive_of(splats).three_scales(splats)[order]
    color = 0.5 + C0 * splats.sh[:, 0].numpy()[order]
    records["rgba"][:, :3] = _byte(color * 255)
    records["rgba"][:, 3] = _byte(opacities[order] * 255)
    quaternions = splats.rotations.double().numpy()[order]
    quaternions = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    records["wxyz"] = _byte(quaternions * 128 + 128)
    return records.tobytes()


def _byte(values: np.ndarray) -> np.ndarray:
    return np.round(values).clip(0, 255).astype(np.uint8)
