"""How whole, smooth and sharp a mesh is: tears, coverage, roughness, sharpness, faces in free space.

None of it needs a truth, except sharpness; with one, it says what is surface and what is flat.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from room2dgs.captures.selection import evenly_spaced
from room2dgs.eval.boundary import open_boundary, pieces, sides
from room2dgs.eval.coverage import coverage
from room2dgs.eval.creases import crease_error, crease_points
from room2dgs.eval.roughness import PATCHES, flat_by_itself, flat_by_truth, roughness
from room2dgs.eval.sampling import Samples, sample_by_area
from room2dgs.eval.sightlines import Sightlines, Tally, ray_depth, sightlines, small_camera, tally
from room2dgs.eval.surface import Surface
from room2dgs.eval.tears import Tears, tears
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.clean import clean

MOST_VIEWS = 100  # evenly spaced ones judge; as many more would say the same
SAMPLES = 40_000  # points of the mesh that are judged
TRUTH_SAMPLES = 100_000
SEED = 0
THROUGH = 2  # views that see through a face, at least, for it to stand in free space


@dataclass(frozen=True)
class KnownView:
    """A training view and what is known of it.

    Attributes:
        camera: of any size.
        depths: z-depth that a source trusts, metres, maps of any size; 0 = unknown. The first that knows counts.
        usable: bool, of any size: pixels that the capture's mask leaves. None: all.
    """

    camera: Camera
    depths: tuple[np.ndarray, ...] = ()
    usable: np.ndarray | None = None


@dataclass(frozen=True)
class MeshQuality:
    """A judged mesh.

    Attributes:
        figures: as `measure` describes them.
        mesh: as it was judged: vertices at one place are one.
        surface: of it.
        views: the views that judged.
        tears: of its boundary.
        in_free_space: (N, 3) points of the mesh that views see through.
    """

    figures: dict[str, Any]
    mesh: trimesh.Trimesh
    surface: Surface
    views: list[Sightlines]
    tears: Tears
    in_free_space: np.ndarray


def measure(mesh: trimesh.Trimesh, views: Sequence[KnownView], truth: trimesh.Trimesh | None = None) -> MeshQuality:
    """Judge a mesh. The same input gives the same figures.

    Args:
        mesh: metres, world of the views.
        views: training views; `MOST_VIEWS` of them are used.
        truth: the true surface; where it has any, its depth stands for the views' own.

    Returns:
        With the figures

        - `tears_per_m`: metres of torn boundary for each m² of mesh that at least `SEEN` views see; `tears_m` itself,
          `boundary_m` of all open boundary and `seen_m2`;
        - `holes`: size class -> number, as `Tears`; `pieces` that the mesh is in, and `islands`, the share of its area
          that is not in the largest;
        - `coverage`, `coverage_known`: share of the pixels of the views, and of those with known depth;
        - `roughness_2cm_deg`, `roughness_10cm_deg`: as `roughness`, on flat parts of the truth, or of the mesh itself;
        - `crease_error_m`, `crease_missing`: as `crease_error`; None without a truth;
        - `in_free_space_m2`, `in_free_space`: area of the mesh that views see through, and its share; None where no
          depth is known;
        - `views`, `known`: number of views, and share of their pixels whose depth is known; `quality_seconds`.
    """
    start = time.perf_counter()
    mesh = clean(mesh)
    surface = Surface(mesh)
    true_surface = None if truth is None else Surface(truth)
    some = evenly_spaced(views, MOST_VIEWS)
    seeing = [_sightlines(one, surface, true_surface) for one in some]
    edges = sides(surface.faces)
    torn = tears(open_boundary(np.asarray(mesh.vertices, np.float64), surface.faces, edges), seeing)
    samples = sample_by_area(mesh, SAMPLES, SEED)
    said = tally(samples.points, seeing, careful=True)
    through = said.empty & (said.free >= THROUGH)
    area = _areas(mesh)
    known = float(np.mean([_share(view.depth[view.usable] > 0) for view in seeing])) if seeing else 0.0
    seen_m2 = float(area.sum() * _share(said.seen))
    figures: dict[str, Any] = {
        "tears_per_m": torn.torn_m / seen_m2 if seen_m2 > 0 else None,
        "tears_m": torn.torn_m,
        "boundary_m": float(torn.boundary.length.sum()),
        "seen_m2": seen_m2,
        "holes": torn.holes,
        **_pieces(pieces(surface.faces, edges), area),
        **coverage(seeing),
        **_against_truth(surface, truth, true_surface, seeing, samples, said),
        "in_free_space_m2": float(area.sum() * _share(through)) if known > 0 else None,
        "in_free_space": _share(through) if known > 0 else None,
        "views": len(seeing),
        "known": known,
    }
    figures["quality_seconds"] = time.perf_counter() - start
    return MeshQuality(figures, mesh, surface, seeing, torn, samples.points[through])


def _sightlines(view: KnownView, mesh: Surface, truth: Surface | None) -> Sightlines:
    true = () if truth is None else (ray_depth(truth, small_camera(view.camera)),)
    return sightlines(view.camera, mesh, (*true, *view.depths), view.usable)


def _against_truth(
    surface: Surface,
    truth: trimesh.Trimesh | None,
    true_surface: Surface | None,
    views: list[Sightlines],
    samples: Samples,
    said: Tally,
) -> dict[str, float | None]:
    """Roughness and sharpness."""
    if truth is None or true_surface is None:
        flat = flat_by_itself(surface, *_facing(surface, samples, said, views))
        return roughness(surface, flat) | {"crease_error_m": None, "crease_missing": None}
    whole = clean(truth)
    welded = Surface(whole)
    of_truth = sample_by_area(whole, TRUTH_SAMPLES, SEED)
    as_truth = [Sightlines(view.camera, view.usable, view.depth, view.depth) for view in views]
    seen = tally(of_truth.points, as_truth)
    flat = flat_by_truth(welded, *_facing(welded, of_truth, seen, views))
    creases = crease_points(np.asarray(whole.vertices, np.float64), welded.faces, welded)
    return roughness(surface, flat) | crease_error(creases, of_truth.points[seen.seen], surface)


def _facing(
    surface: Surface, samples: Samples, said: Tally, views: Sequence[Sightlines]
) -> tuple[np.ndarray, np.ndarray]:
    """Seen points, at most `PATCHES`, and their normals towards a camera that sees them."""
    seen = np.flatnonzero(said.seen)
    seen = seen[:: max(1, -(-len(seen) // PATCHES))]
    points, normals = samples.points[seen], surface.face_normals[samples.triangle[seen]]
    if not len(seen):
        return points, normals
    centres = np.stack([view.camera.centre for view in views])[said.first[seen]]
    towards = np.einsum("nc,nc->n", normals, centres - points) >= 0
    return points, np.where(towards[:, None], normals, -normals)


def _pieces(piece: np.ndarray, area: np.ndarray) -> dict[str, Any]:
    by_piece = np.bincount(piece, area) if len(piece) else np.zeros(0)
    total = by_piece.sum()
    return {"pieces": len(by_piece), "islands": float(1 - by_piece.max() / total) if total > 0 else 0.0}


def _areas(mesh: trimesh.Trimesh) -> np.ndarray:
    corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces).reshape(-1, 3)]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def _share(mask: np.ndarray) -> float:
    return float(mask.mean()) if len(mask) else 0.0
