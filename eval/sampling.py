"""Points spread over a mesh by area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from room2dgs.mesh.checks import check_mesh


@dataclass(frozen=True)
class Samples:
    """Points on a surface.

    Attributes:
        points: (N, 3) float64, metres, world.
        triangle: (N,) int64, the face each lies on.
    """

    points: np.ndarray
    triangle: np.ndarray

    def __getitem__(self, keep: np.ndarray) -> Samples:  # an index array or a mask selects samples, not fields
        return Samples(self.points[keep], self.triangle[keep])


def sample_by_area(mesh: trimesh.Trimesh, count: int, seed: int) -> Samples:
    """Seeded samples, uniform by area and stratified: every `1 / count` of the area holds exactly one.

    So the share of a part of the surface is met to one sample, where independent samples would miss it
    by sqrt(count). A mesh without area gives no samples.

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be.
    """
    check_mesh(mesh)
    corners = np.asarray(mesh.vertices, dtype=np.float64)[np.asarray(mesh.faces).reshape(-1, 3)]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    cumulative = np.cumsum(np.linalg.norm(np.cross(first, second), axis=1))
    if not len(cumulative) or cumulative[-1] <= 0 or count <= 0:
        return Samples(np.zeros((0, 3)), np.zeros(0, dtype=np.int64))
    rng = np.random.default_rng(seed)
    place = (np.arange(count) + rng.random(count)) / count * cumulative[-1]
    triangle = np.searchsorted(cumulative, place, side="right").clip(max=len(cumulative) - 1)
    # folding the unit square's far half back keeps the density uniform in the triangle
    weights = rng.random((count, 2))
    weights = np.where(weights.sum(axis=1, keepdims=True) > 1, 1 - weights, weights)
    points = corners[triangle, 0] + weights[:, :1] * first[triangle] + weights[:, 1:] * second[triangle]
    return Samples(points, triangle)
