"""Input and output of every protocol."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.eval.geometry_scores import Scores, downsample, nearest_vertices, scores
from room2dgs.eval.placement import check_together
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.checks import check_mesh
from room2dgs.mesh.world import read_in_scene


@dataclass(frozen=True)
class Options:
    """Settings of a protocol.

    Attributes:
        threshold_m: of precision, recall and F-score, metres.
        samples: protocol `area`: observed points wanted on each mesh.
        seed: protocol `area`: of the random samples.
    """

    threshold_m: float = 0.05
    samples: int = 200_000
    seed: int = 0


@dataclass(frozen=True)
class MeshFile:
    """A mesh and the file that it came from.

    Attributes:
        sha256: of the file's bytes; None for a mesh that came from no file.
    """

    mesh: trimesh.Trimesh
    path: Path | None = None
    sha256: str | None = None

    @cached_property
    def surface(self) -> Surface:
        """The mesh for distances and ray casts, built once."""
        return Surface(self.mesh)


@dataclass(frozen=True)
class Result:
    """Scores by one protocol.

    Attributes:
        constants: every number that the protocol depends on, by name.
    """

    protocol: str
    scores: Scores
    constants: dict[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """One flat entry for metrics.json: the scores, and the constants under "constants"."""
        return {**self.scores.as_dict(), "constants": self.constants}


# A protocol scores a prediction against a ground truth as these cameras see them.
Protocol = Callable[[MeshFile, MeshFile, Sequence[Camera], Options], Result]


def load(source: str | Path | trimesh.Trimesh | MeshFile, origin_m: Origin = AT_ORIGIN) -> MeshFile:
    """Read a mesh and hash its file; a mesh stays as it is.

    Args:
        origin_m: of the scene whose cameras are to see the mesh (`Scene.origin_m`), in the world of the file.

    Raises:
        InputError: as `read_mesh` and `check_together`.
        TypeError, ValueError: neither a path nor a mesh, or one of faces or vertices that cannot be.
    """
    if isinstance(source, MeshFile):
        return source
    if not isinstance(source, str | Path):
        check_mesh(source)
        check_together(source, "the mesh")
        return MeshFile(source)
    path = Path(source)
    mesh = read_in_scene(path, origin_m)
    check_together(mesh, str(path))
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return MeshFile(mesh, path, digest.hexdigest())


def hashes(pred: MeshFile, gt: MeshFile) -> dict[str, str | None]:
    """The two files' hashes, as constants of a result."""
    return {"pred_sha256": pred.sha256, "gt_sha256": gt.sha256}


def by_vertex(
    name: str,
    pred: MeshFile,
    gt: MeshFile,
    vertices: tuple[np.ndarray, np.ndarray],
    cell_m: float,
    threshold_m: float,
    constants: dict[str, Any],
) -> Result:
    """Scores by a protocol that compares vertices, averaged in cells, by nearest neighbours.

    Args:
        vertices: (N, 3) of the prediction and (M, 3) of the ground truth, culled as the protocol wants it; metres.
        cell_m: edge of the cells.
        constants: what else the protocol depends on.
    """
    pred_points, gt_points = (downsample(np.asarray(points).reshape(-1, 3), cell_m) for points in vertices)
    distances = nearest_vertices(pred_points, gt_points), nearest_vertices(gt_points, pred_points)
    shared = {
        "threshold_m": threshold_m,
        **constants,
        "downsample_m": cell_m,
        "pred_points": len(pred_points),
        "gt_points": len(gt_points),
        "gt_edge_m": edge_length(gt.mesh),
        "distances": "vertex to nearest vertex, strict < threshold, not clamped",
        **hashes(pred, gt),
    }
    return Result(name, scores(*distances, threshold_m), shared)


def edge_length(mesh: trimesh.Trimesh) -> float:
    """Area-weighted mean of the faces' longest edges, metres: how densely the vertices cover the surface."""
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return float((edges * area).sum() / max(area.sum(), 1e-30))
