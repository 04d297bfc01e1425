"""How large a voxel should be: what the photos resolve, and no finer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.config import MeshConfig
from room2dgs.geometry.camera import Camera

if TYPE_CHECKING:
    from room2dgs.mesh.tsdf import Fusion

PIXELS = 2.0  # of a photo, a side
AT_M = 2.5  # how far a room's surfaces are from the camera, in the middle
SMALLEST_M, LARGEST_M = 0.01, 0.02
STEP_M = 0.001


def voxel_side(config: MeshConfig | Fusion) -> float:
    """Metres: the side of the voxels in settings that `with_voxel` has completed."""
    assert config.voxel_m is not None
    return config.voxel_m


def with_voxel(config: MeshConfig, cameras: Sequence[Camera]) -> MeshConfig:
    """The settings with a side for the voxels: two pixels at 2.5 m, 1 to 2 cm, if `voxel_m` is null.

    Smaller ones make the mesh rougher and dearer, and hardly more exact (docs/studies/mesh.md).

    Args:
        cameras: of the views that are fused; at least one.
    """
    if config.voxel_m is not None:
        return config
    focal = float(np.median([camera.K[(0, 1), (0, 1)].mean() for camera in cameras]))
    side = np.clip(PIXELS * AT_M / focal, SMALLEST_M, LARGEST_M)
    return replace(config, voxel_m=float(np.round(side / STEP_M) * STEP_M))
