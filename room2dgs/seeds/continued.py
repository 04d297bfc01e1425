"""A surface that goes on beyond what the photos show.

A view beside the photos sees past their borders. Gaussians that nothing trains stay as they start: with a piece of wall
there, such a view shows wall in place of a hole.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from room2dgs.geometry.camera import Camera
from room2dgs.seeds.depth_seeds import MIN_SEPARATION, Surface, suppressed
from room2dgs.seeds.voxelise import cell_centres, cell_keys

SMOOTHED = 16  # pieces whose mean normal and colour a new one has
STEPS = np.array([step for step in product((-1, 0, 1), repeat=3) if any(step)])  # to the cells around one
RIM = 0.06  # of an image's shorter side, within which its own depth is often cut away


def continued(surface: Surface, cameras: Sequence[Camera], voxel_m: float, beyond_m: float) -> Surface:
    """The surface with its pieces carried on in their tangent planes, where no camera looks.

    Args:
        surface: one piece a cell.
        cameras: of the photos: a new piece lies outside of all of them or on their rims, hidden or not.
        voxel_m: edge of a cell, and the step from piece to piece.
        beyond_m: about how far from the surface; as many steps to the next cells, diagonal ones among them.
    """
    edge = surface
    for _ in range(round(beyond_m / voxel_m)):
        if len(edge.xyz):
            edge = _next_ring(surface, edge, cameras, voxel_m)
            surface = Surface(*(np.concatenate(both) for both in zip(surface, edge, strict=True)))
    return surface


def _next_ring(surface: Surface, edge: Surface, cameras: Sequence[Camera], voxel_m: float) -> Surface:
    """The pieces in the free cells beside those of `edge`, where its tangent planes cross them."""
    centres = (edge.cells[:, None] + STEPS * voxel_m).reshape(-1, 3)
    normals = np.repeat(edge.normals, len(STEPS), axis=0)
    above = ((centres - np.repeat(edge.xyz, len(STEPS), axis=0)) * normals).sum(axis=1)
    xyz, keys = centres - above[:, None] * normals, cell_keys(centres, voxel_m)
    free = (cell_keys(xyz, voxel_m) == keys) & ~np.isin(keys, cell_keys(surface.cells, voxel_m))
    keys, first = np.unique(keys[free], return_index=True)
    xyz = xyz[free][first]
    tree = cKDTree(surface.xyz)
    kept = tree.query(xyz)[0] >= MIN_SEPARATION * voxel_m
    for camera in cameras:
        kept &= ~_looks_at(camera, xyz)
    keys, xyz = keys[kept], xyz[kept]
    near = tree.query(xyz, k=list(range(1, min(SMOOTHED, len(surface.xyz)) + 1)))[1]
    normals = surface.normals[near].mean(axis=1)
    length = np.linalg.norm(normals, axis=1)
    good = length > 0.5  # else it would go around an edge
    good &= ~suppressed(xyz, np.where(good, 1.0, 0.0), MIN_SEPARATION * voxel_m)
    ring = Surface(
        cell_centres(keys, voxel_m), xyz, normals / np.maximum(length, 0.5)[:, None], surface.rgb[near].mean(axis=1)
    )
    return Surface(*(values[good] for values in ring))


def _looks_at(camera: Camera, xyz: np.ndarray) -> np.ndarray:
    """(N,) bool: points inside the image without its rim."""
    pixel, _ = camera.project(xyz)
    rim = RIM * min(camera.size)
    return np.asarray(((pixel >= rim) & (pixel < np.subtract(camera.size, rim))).all(axis=1))
