"""The expected error of a mesh's faces along their normals, as its file says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from room2dgs.captures.ply_elements import read_elements
from room2dgs.mesh.vertex_source import EXPECTED_ERROR

UNSEEN_M = 0.05  # where no view tells anything
MEND = "mesh the run again"


def expected_errors(path: Path, mesh: trimesh.Trimesh) -> np.ndarray | None:
    """(F,) standard deviation of each face along its normal, metres; None: the file does not say.

    Raises:
        InputError: the file is damaged.
    """
    found = read_elements(path, ("vertex",), MEND)["vertex"].single.get(EXPECTED_ERROR)
    if found is None or len(found) != len(mesh.vertices):
        return None
    known = np.where(np.isfinite(found) & (found > 0), found, UNSEEN_M).astype(np.float64)
    return known[np.asarray(mesh.faces)].mean(axis=1)
