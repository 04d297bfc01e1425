"""Seeds with what the point cloud says about the surface around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from room2dgs.config import SeedsConfig
from room2dgs.seeds.neighbourhood import local_normals, spacing
from room2dgs.seeds.voxelise import voxelise


@dataclass(frozen=True)
class Seeds:
    """S anchors of surfels.

    Attributes:
        positions: (S, 3) float64, voxel centres (eq. 8), metres.
        surface: (S, 3) float64, mean of the seed's points: where its surfels start, metres.
        normals: (S, 3) float64, unit, towards the cameras.
        spacing: (S,) float64, metres to the neighbouring seeds.
        rgb: (S, 3) float64, 0..1.
    """

    positions: np.ndarray
    surface: np.ndarray
    normals: np.ndarray
    spacing: np.ndarray
    rgb: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)


def seed_points(xyz: np.ndarray, rgb: np.ndarray, camera_centres: np.ndarray, config: SeedsConfig) -> Seeds:
    """Seeds of a sparse point cloud.

    Args:
        xyz: (M, 3) metres.
        rgb: (M, 3) uint8.
        camera_centres: (C, 3) metres.

    Raises:
        InputError: no points, or points out of range.
    """
    voxels = voxelise(xyz, rgb, config.voxel_m)
    low = min(config.voxel_m / 4, config.max_scale_m)
    return Seeds(
        positions=voxels.centres,
        surface=voxels.means,
        normals=local_normals(xyz, voxels.means, config.neighbours, np.mean(camera_centres, axis=0)),
        spacing=spacing(voxels.means, low, config.max_scale_m),
        rgb=voxels.rgb / 255.0,
    )
