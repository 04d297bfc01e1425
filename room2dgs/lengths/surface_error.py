"""The expected error of a mesh's faces along their normals: the mesh's own, or what the run's small maps say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from room2dgs.captures.ply_elements import read_elements
from room2dgs.captures.scene import Frame
from room2dgs.captures.uncertainty import completed_sigma
from room2dgs.mesh.vertex_source import EXPECTED_ERROR
from room2dgs.runs.trust import Trust

UNSEEN_M = 0.05  # where no view tells anything
# Of a voxel: what a fused surface is off by as a whole, which no single view tells. A mesh's own error has it in it.
BIAS_STEPS = 0.2
SHARED = 0.4  # of the views' variance: causes that all views of a place share
NEAR_SIGMAS, NEAR_M = 2.0, 0.03  # a view whose depth is farther off shows something else
MEND = "mesh the run again"


@dataclass(frozen=True)
class SurfaceError:
    """Of a mesh's faces, F of them.

    Attributes:
        sigma_m: (F,) standard deviation along the normal, metres.
        source: what it comes from, in words.
        bias_steps: standard deviation, in voxels, of what all of a surface is off by together, beside that.
    """

    sigma_m: np.ndarray
    source: str
    bias_steps: float = 0.0


def error_of_file(path: Path, mesh: trimesh.Trimesh) -> SurfaceError | None:
    """What mesh.ply itself says; None: it says nothing.

    Raises:
        InputError: the file is damaged.
    """
    found = read_elements(path, ("vertex",), MEND)["vertex"].single.get(EXPECTED_ERROR)
    if found is None or len(found) != len(mesh.vertices):
        return None
    known = np.where(np.isfinite(found) & (found > 0), found, UNSEEN_M).astype(np.float64)
    return SurfaceError(known[np.asarray(mesh.faces)].mean(axis=1), "the mesh's expected error")


def error_of_views(mesh: trimesh.Trimesh, frames: Sequence[Frame], maps: Mapping[str, Trust]) -> SurfaceError:
    """From each view's depth and the error that is expected of it, where it shows the face.

    Of k views with variances v_i, the face has v (s + (1 - s) / k), v their harmonic mean: s is what they share.

    Args:
        mesh: scene's frame.
        maps: of training views, by name (`read_trust`).
    """
    middle = np.asarray(mesh.triangles_center, np.float64)
    normal = np.asarray(mesh.face_normals, np.float64)
    count, weight = np.zeros(len(middle)), np.zeros(len(middle))
    for frame in frames:
        trust = maps.get(frame.name)
        if trust is None or trust.depth is None:
            continue
        shown, sigma = _by_view(frame, trust, trust.depth, middle, normal)
        count[shown] += 1
        weight[shown] += 1 / np.maximum(sigma, 1e-4) ** 2
    seen = count > 0
    sigma_m = np.full(len(middle), UNSEEN_M)
    mean = count[seen] / weight[seen]
    sigma_m[seen] = np.sqrt(mean * (SHARED + (1 - SHARED) / count[seen]))
    return SurfaceError(np.minimum(sigma_m, UNSEEN_M), "the views' expected errors of depth", BIAS_STEPS)


def _by_view(
    frame: Frame, trust: Trust, depth: np.ndarray, middle: np.ndarray, normal: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the faces that a view shows, and their deviation along the normal as it alone would tell it."""
    height, width = depth.shape
    camera = frame.camera.resized(width, height)
    inside, column, row, z = camera.pixels_of(middle, 0.0)
    told, sure = depth[row, column].astype(np.float64), trust.confidence[row, column] / 255
    relative = completed_sigma(np.maximum(sure, 1e-3).astype(np.float32)).astype(np.float64)
    near = np.abs(told - z) < NEAR_SIGMAS * relative * z + NEAR_M
    shown = inside[(told > 0) & near]
    along = np.abs(((middle[shown] - camera.centre) * normal[shown]).sum(axis=1))
    return shown, relative[(told > 0) & near] * along
