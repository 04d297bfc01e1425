"""A seed's first surfels (eq. 9)."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from room2dgs.config import Config
from room2dgs.geometry.arguments import number, whole_number
from room2dgs.geometry.rotations import quaternions_to, tangents
from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.seeds import Seeds

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


def first_opacity(config: Config) -> float:
    """Of new surfels: nearly opaque where depth priors place seeds on the surface; points alone may lie anywhere."""
    placed = config.seeds.init == "sfm+depth" and config.prior.depth.source != "none"
    return config.seeds.opacity if placed else config.seeds.faint_opacity


def spawn(seeds: Seeds, per_seed: int, opacity: float, random_seed: int) -> Spawned:
    """Spread k discs evenly over each seed's patch of surface.

    The offsets follow a sunflower of radius `spacing` in the tangent plane through the seed's mean
    point, turned by a random angle a seed: all k differ (k coincident surfels would get k equal
    gradients and stay one), and no part of the patch is left bare. The discs' scale is
    spacing / sqrt(k), so that together they cover the same area whatever k is.

    Args:
        seeds: S seeds.
        per_seed: k.
        opacity: of every surfel.
        random_seed: the same number gives the same bits.

    Raises:
        TypeError, ValueError: no such numbers.
    """
    whole_number("per_seed", per_seed, 1)
    number("opacity", opacity)
    whole_number("random_seed", random_seed)
    count = len(seeds)
    quaternions = quaternions_to(seeds.normals)
    axes = tangents(torch.from_numpy(quaternions)).numpy()  # (S, 2, 3)
    index = np.arange(per_seed)
    radius = np.sqrt(index / per_seed) * seeds.spacing[:, None]
    turn = np.random.default_rng([random_seed, 0x5EED]).uniform(0.0, 2 * math.pi, (count, 1))
    angle = index * GOLDEN_ANGLE + turn
    in_plane = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)  # (S, k, 2)
    offsets = (seeds.surface - seeds.positions)[:, None] + np.einsum("ska,sai->ski", in_plane, axes)
    scale = seeds.spacing / math.sqrt(per_seed)

    def repeated(values: np.ndarray, width: int) -> Tensor:
        rows = np.broadcast_to(values.reshape(count, 1, -1), (count, per_seed, width))
        return torch.from_numpy(np.ascontiguousarray(rows, dtype=np.float32))

    return Spawned(
        positions=torch.from_numpy(seeds.positions.astype(np.float32)),
        offsets=torch.from_numpy(offsets.astype(np.float32)),
        rotations=repeated(quaternions, 4),
        scales=repeated(scale, 2),
        opacities=torch.full((count, per_seed), opacity, dtype=torch.float32),
        sh_dc=repeated((seeds.rgb - 0.5) / C0, 3),
    )
