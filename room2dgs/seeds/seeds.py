"""Seeds, with normal, spacing and colour of the surface around them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from room2dgs.config import SeedsConfig
from room2dgs.geometry.arguments import check_points, whole_number
from room2dgs.seeds.depth_seeds import Surface
from room2dgs.seeds.neighbourhood import local_normals, spacing
from room2dgs.seeds.voxelise import point_keys, voxelise

POINT_MIN_M, POINT_MAX_M = 1e-3, 1.0  # scales of init=points: neighbours may coincide, or be outliers


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


def seed_points(
    xyz: np.ndarray, rgb: np.ndarray, camera_centres: np.ndarray, config: SeedsConfig, random_seed: int = 0
) -> Seeds:
    """Seeds of a sparse point cloud, as `config.init` says.

    Args:
        xyz: (M, 3) metres.
        rgb: (M, 3) uint8.
        camera_centres: (C, 3) metres.
        random_seed: for init=points: the same number gives the same normals.

    Raises:
        InputError: no points, or points out of range.
        TypeError, ValueError: no such points, colours or cameras, or not as many colours as points.
    """
    xyz, rgb = check_points("xyz", xyz), check_points("rgb", rgb)
    if len(rgb) != len(xyz):
        raise ValueError(f"there are {len(rgb)} colours for {len(xyz)} points")
    if not len(check_points("camera_centres", camera_centres)) or not np.isfinite(camera_centres).all():
        raise ValueError("camera_centres are none, or not finite")
    whole_number("random_seed", abs(random_seed) if isinstance(random_seed, int) else random_seed)
    if config.init == "points":
        point_keys(xyz, config.voxel_m)  # refuses what cannot be used
        return _every_point(xyz, rgb, random_seed)
    voxels = voxelise(xyz, rgb, config.voxel_m)
    low = min(config.voxel_m / 4, config.max_scale_m)
    return Seeds(
        positions=voxels.centres,
        surface=voxels.means,
        normals=local_normals(xyz, voxels.means, config.neighbours, np.mean(camera_centres, axis=0)),
        spacing=spacing(voxels.means, low, config.max_scale_m),
        rgb=voxels.rgb / 255.0,
    )


def _every_point(xyz: np.ndarray, rgb: np.ndarray, random_seed: int) -> Seeds:
    """2DGS's initialisation: a seed a point, as large as its neighbours are far, facing anywhere."""
    positions = np.asarray(xyz, dtype=np.float64)
    normals = np.random.default_rng([random_seed % 2**63, 0x9017]).standard_normal((len(positions), 3))
    return Seeds(
        positions=positions,
        surface=positions,
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        spacing=spacing(positions, POINT_MIN_M, POINT_MAX_M, squared=True),
        rgb=np.asarray(rgb, dtype=np.float64) / 255.0,
    )


def surface_seeds(surface: Surface, config: SeedsConfig) -> Seeds:
    """A seed for each piece of a surface (`depth_seeds.prior_surface`)."""
    return Seeds(
        positions=surface.cells,
        surface=surface.xyz,
        normals=surface.normals,
        spacing=spacing(surface.xyz, config.depth_voxel_m / 4, max(config.depth_voxel_m, config.max_scale_m)),
        rgb=surface.rgb,
    )


def joined(first: Seeds, second: Seeds) -> Seeds:
    """Both, in this order."""
    return Seeds(*(np.concatenate([getattr(part, f.name) for part in (first, second)]) for f in fields(Seeds)))
