"""Gradient-guided growth (the paper's Sec. III-B): new seeds where the surfels' screen-space gradients are large."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from room2dgs.geometry.arguments import number, whole_number
from room2dgs.seeds.hierarchy import Cells, cells_of, coarser, in_grid, level_edge
from room2dgs.seeds.seeds import Seeds
from room2dgs.seeds.voxelise import cell_centres, cell_keys


class Parents(NamedTuple):
    """Surfels that are there already, k of each seed adjacent.

    Attributes:
        seeds: (S, 3) positions, metres.
        centres: (N, 3) metres.
        normals: (N, 3) unit, on either side.
        scales: (N,) metres, one a disc.
        rgb: (N, 3) 0..1.
        gradients: (N,) mean norm of the screen-space gradient, in 2DGS's units.
        known: (N,) bool: seen often enough for the mean to be usable.
    """

    seeds: np.ndarray
    centres: np.ndarray
    normals: np.ndarray
    scales: np.ndarray
    rgb: np.ndarray
    gradients: np.ndarray
    known: np.ndarray


class Growth(NamedTuple):
    """B new seeds.

    Attributes:
        seeds: where and how they start.
        level: (B,) of the hierarchy, 0 the coarsest.
        gradient: (B,) mean over the cell's surfels.
        family: the surfels of each one's cell, by index.
    """

    seeds: Seeds
    level: np.ndarray
    gradient: np.ndarray
    family: Cells

    def __len__(self) -> int:
        return len(self.level)

    def largest(self, count: int) -> Growth:
        """At most `count` of them, those with the largest gradients, in their order."""
        if count >= len(self):
            return self
        chosen = np.zeros(len(self), bool)
        chosen[np.argsort(-self.gradient, kind="stable")[:count]] = True
        seeds = Seeds(**{name: values[chosen] for name, values in vars(self.seeds).items()})
        return Growth(seeds, self.level[chosen], self.gradient[chosen], self.family.only(chosen))


def grow(
    parents: Parents,
    voxel_m: float,
    levels: int,
    threshold: float,
    max_spacing_m: float,
    per_seed: int,
    draws: np.random.Generator | None = None,
) -> Growth:
    """New seeds in cells without a seed whose surfels' mean gradient exceeds the level's threshold.

    Coarse to fine, the threshold doubles from level to level (Scaffold-GS): empty space near surfels fills with
    little cause, fine cells need much. A seed added at one level occupies its cell at all later ones, so no cell
    of a level is given a seed when it has one.

    A new seed sits at the centre of its cell; its surfels start at the mean of the cell's surfels, facing as they
    do. Its patch is no wider than the cell, `max_spacing_m`, or what a seed with discs like its parents' covers.

    Args:
        voxel_m: edge of the finest cells.
        levels: of the hierarchy, each 4 times finer than the one before.
        threshold: of the coarsest level.
        per_seed: surfels that a seed will have.
        draws: lets cells of level i survive with probability 1 - 0.5^(i+1), as Scaffold-GS; None: all do.

    Raises:
        TypeError, ValueError: no such numbers.
    """
    whole_number("levels", levels, 1)
    whole_number("per_seed", per_seed, 1)
    number("voxel_m", voxel_m, above=0.0)
    number("threshold", threshold)
    usable = np.flatnonzero(parents.known & in_grid(parents.centres, voxel_m))
    keys = cell_keys(parents.centres[usable], voxel_m)
    occupied = cell_keys(parents.seeds, voxel_m)
    added = []
    for level in range(levels):
        cells = cells_of(coarser(keys, level, levels))
        gradient = cells.mean(parents.gradients[usable])
        chosen = gradient > threshold * 2**level
        chosen &= ~np.isin(cells.keys, coarser(occupied, level, levels))
        if draws is not None:
            chosen &= draws.random(len(chosen)) < 1 - 0.5 ** (level + 1)
        cells = cells.only(chosen)
        family = cells._replace(order=usable[cells.order])
        edge = level_edge(voxel_m, level, levels)
        seeds = _new_seeds(parents, family, edge, voxel_m / 4, min(edge, max_spacing_m), per_seed)
        occupied = np.concatenate([occupied, cell_keys(seeds.positions, voxel_m)])
        added.append(Growth(seeds, np.full(len(gradient[chosen]), level), gradient[chosen], family))
    return _joined(added)


def _new_seeds(parents: Parents, family: Cells, edge: float, low_m: float, high_m: float, per_seed: int) -> Seeds:
    scales = family.mean(parents.scales)
    return Seeds(
        # as they will be stored, so that a seed's cell is the same at every later growth
        positions=cell_centres(family.keys, edge).astype(np.float32).astype(np.float64),
        surface=family.mean(parents.centres),
        normals=_mean_axes(parents.normals, family),
        spacing=np.clip(scales * math.sqrt(per_seed), min(low_m, high_m), high_m),
        rgb=family.mean(parents.rgb),
    )


def _mean_axes(normals: np.ndarray, family: Cells) -> np.ndarray:
    """Unit means of normals whose side does not matter: the leading eigenvector of sum n n^T."""
    outer = family.mean(normals[:, :, None] * normals[:, None, :])
    return np.linalg.eigh(outer)[1][:, :, -1]


def _joined(parts: list[Growth]) -> Growth:
    families = [part.family for part in parts]
    counts = np.concatenate([family.counts for family in families])
    return Growth(
        Seeds(**{name: np.concatenate([getattr(p.seeds, name) for p in parts]) for name in vars(parts[0].seeds)}),
        np.concatenate([part.level for part in parts]),
        np.concatenate([part.gradient for part in parts]),
        Cells(
            np.concatenate([family.keys for family in families]),
            np.concatenate([family.order for family in families]),
            np.cumsum(counts) - counts,
            counts,
        ),
    )
