"""Roughness: how far normals of a mesh turn away from the plane where its surface is flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from room2dgs.eval.patches import heights, residuals, slopes, tangents
from room2dgs.eval.surface import Surface

AT_M = (0.02, 0.10)  # squares over which a normal is taken
REACH_M = 0.05  # of a mesh from the plane: what is farther off is wrong or missing, not rough
PATCHES = 6000  # flat places that are looked at, at most
TRUTH_M, TRUTH_STEPS, TRUTH_OFF_M = 0.20, 7, 0.003  # a truth is flat where a square is so even
FOUND_M, FOUND_STEPS, FOUND_OFF_M, FOUND_SHARE = 0.50, 7, 0.025, 0.8  # likewise a mesh, but for a share of the square


@dataclass(frozen=True)
class FlatPlaces:
    """Points of planes.

    Attributes:
        points: (N, 3) metres.
        normals: (N, 3) unit, towards the cameras.
    """

    points: np.ndarray
    normals: np.ndarray


def roughness(surface: Surface, places: FlatPlaces) -> dict[str, float | None]:
    """ "roughness_2cm_deg" and "roughness_10cm_deg": root mean square angle, degrees, between the planes' normals and
    the mesh's, each of the least-squares plane over a square of that size; None without flat places.
    """
    found: dict[str, float | None] = {}
    for size in AT_M:
        _, right, up = slopes(heights(surface, places.points, places.normals, size, 3, REACH_M), size)
        angle = np.degrees(np.arctan(np.hypot(right, up)))
        angle = angle[np.isfinite(angle)]
        found[f"roughness_{size * 100:g}cm_deg"] = float(np.sqrt((angle**2).mean())) if len(angle) else None
    return found


def flat_by_truth(truth: Surface, points: np.ndarray, normals: np.ndarray) -> FlatPlaces:
    """Those points of the truth about which it is even.

    Args:
        points, normals: (N, 3) on the truth, unit normals towards the cameras.
    """
    height = heights(truth, points, normals, TRUTH_M, TRUTH_STEPS, REACH_M)
    off = np.abs(residuals(height, TRUTH_M)).max(axis=(1, 2))
    return _kept(points, normals, height, TRUTH_M, off <= TRUTH_OFF_M)


def flat_by_itself(mesh: Surface, points: np.ndarray, normals: np.ndarray) -> FlatPlaces:
    """Those points of a mesh about which most of it lies near a plane, moved onto the plane.

    Args:
        points, normals: as `flat_by_truth`, on the mesh.
    """
    height = heights(mesh, points, normals, FOUND_M, FOUND_STEPS, 2 * REACH_M)
    offset = np.linspace(-FOUND_M / 2, FOUND_M / 2, FOUND_STEPS)
    y, x = (grid.ravel() for grid in np.meshgrid(offset, offset, indexing="ij"))
    design = np.stack([np.ones_like(x), x, y], axis=1)
    flat = np.nan_to_num(height.reshape(len(height), len(x)))
    there = np.isfinite(height).reshape(flat.shape)
    on, plane = there, np.zeros((len(flat), 3))
    for _ in range(3):
        normal = np.einsum("nk,ki,kj->nij", on, design, design) + 1e-9 * np.eye(3)
        plane = np.linalg.solve(normal, np.einsum("nk,ki,nk->ni", on, design, flat)[..., None])[..., 0]
        on = there & (np.abs(flat - plane @ design.T) <= FOUND_OFF_M)
    good = on.mean(axis=1) >= FOUND_SHARE
    return _on_plane(points[good], normals[good], plane[good])


def _kept(points: np.ndarray, normals: np.ndarray, height: np.ndarray, size_m: float, good: np.ndarray) -> FlatPlaces:
    plane = np.stack(slopes(height, size_m), axis=1)
    return _on_plane(points[good], normals[good], plane[good])


def _on_plane(points: np.ndarray, normals: np.ndarray, plane: np.ndarray) -> FlatPlaces:
    """Points and normals moved onto planes: (N, 3) height, slope to the right, slope up."""
    right, up = tangents(normals)
    turned = normals - plane[:, 1:2] * right - plane[:, 2:] * up
    turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12)
    return FlatPlaces(points + plane[:, :1] * normals, turned)
