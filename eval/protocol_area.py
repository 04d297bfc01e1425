"""Protocol `area`, the default: seeded area samples of what the cameras saw, exact distances to triangles.

Free of tessellation and image resolution. Both meshes are sampled by area, the samples are culled to what
the cameras observed (`culling`), and each kept sample's distance to the other mesh, whole, is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from room2dgs.eval import culling
from room2dgs.eval.geometry_scores import scores
from room2dgs.eval.protocol import MeshFile, Options, Result, hashes
from room2dgs.eval.sampling import Samples, sample_by_area
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera

PROBE_SHARE = 0.1  # this share of the samples is drawn first, to learn which part is observed
LARGEST_DRAW = 10  # at most so many times the wanted samples are drawn when little is observed


@dataclass(frozen=True)
class Compared:
    """Observed samples of one mesh against the other mesh.

    Attributes:
        samples: N observed samples.
        normals: (N, 3) unit normals of the samples' own faces.
        view: (N,) int64, a camera that observes each.
        distance: (N,) metres to the other mesh.
        other_triangle: (N,) the other mesh's nearest face, -1 without faces.
        cosine: (N,) |n . n'| with the nearest face's normal; 0 without faces.
        drawn: samples drawn before culling.
    """

    samples: Samples
    normals: np.ndarray
    view: np.ndarray
    distance: np.ndarray
    other_triangle: np.ndarray
    cosine: np.ndarray
    drawn: int


@dataclass(frozen=True)
class AreaResult(Result):
    """The verdict and the samples behind it, for pictures and for saying where the error sits."""

    pred: Compared
    gt: Compared


def area(pred: MeshFile, gt: MeshFile, cameras: Sequence[Camera], options: Options) -> AreaResult:
    """Score with area samples.

    Args:
        cameras: all usable views of the scene; their images bound what is judged.
        options: threshold_m, samples (wanted observed samples a mesh) and seed are used.
    """
    pred_surface, gt_surface = pred.surface, gt.surface
    forth = compared(pred.mesh, pred_surface, gt_surface, gt_surface, cameras, options)
    back = compared(gt.mesh, gt_surface, pred_surface, gt_surface, cameras, options)
    consistency = (
        float(forth.cosine.mean() + back.cosine.mean()) / 2 if len(forth.cosine) and len(back.cosine) else None
    )
    return AreaResult(
        protocol="area",
        scores=scores(forth.distance, back.distance, options.threshold_m, consistency),
        constants={
            "threshold_m": options.threshold_m,
            "samples_wanted": options.samples,
            "seed": options.seed,
            "pred_samples": len(forth.distance),
            "pred_samples_drawn": forth.drawn,
            "gt_samples": len(back.distance),
            "gt_samples_drawn": back.drawn,
            "views": len(cameras),
            "near_m": culling.NEAR_M,
            "occlusion_tolerance_m": culling.TOLERANCE_M,
            "distances": "sample to triangle, strict < threshold, not clamped",
            **hashes(pred, gt),
        },
        pred=forth,
        gt=back,
    )


def compared(
    mesh: trimesh.Trimesh,
    own: Surface,
    other: Surface,
    truth: Surface,
    cameras: Sequence[Camera],
    options: Options,
) -> Compared:
    """Observed samples of one mesh against the other one.

    Args:
        mesh, own: the samples' mesh.
        other: what distances are measured to.
        truth: tells what the cameras observe.
    """
    probe = sample_by_area(mesh, max(1, int(options.samples * PROBE_SHARE)), options.seed)
    seen = float((culling.first_view(probe.points, cameras, own, truth) >= 0).mean()) if len(probe.points) else 0.0
    drawn = int(min(options.samples / max(seen, 1e-9), options.samples * LARGEST_DRAW))
    samples = sample_by_area(mesh, drawn, options.seed)
    view = culling.first_view(samples.points, cameras, own, truth)
    samples, view = samples[view >= 0], view[view >= 0]
    normals = own.face_normals[samples.triangle]
    distance, nearest = other.closest(samples.points)
    cosine = np.zeros(len(distance))
    if len(other.faces):
        cosine = np.abs(np.einsum("nc,nc->n", normals, other.face_normals[nearest]))
    return Compared(samples, normals, view, distance, nearest, cosine, drawn)
