"""The expected error of a mesh's faces along their normals, as the mesh says, and what a face weighs by it."""

from __future__ import annotations

import numpy as np
import trimesh

from room2dgs.mesh.vertex_source import EXPECTED_ERROR, told_by

UNSEEN_M = 0.05  # where no view tells anything


def expected_errors(mesh: trimesh.Trimesh) -> np.ndarray | None:
    """(F,) standard deviation of each face along its normal, metres; None: the mesh does not say."""
    found = told_by(mesh, EXPECTED_ERROR)
    if found is None:
        return None
    known = np.where(np.isfinite(found) & (found > 0), found, UNSEEN_M).astype(np.float64)
    return known[np.asarray(mesh.faces)].mean(axis=1)


def face_weight(area: np.ndarray, sigma_m: np.ndarray) -> np.ndarray:
    """What each face counts for the place of a plane: its area over its variance."""
    return area / sigma_m**2
