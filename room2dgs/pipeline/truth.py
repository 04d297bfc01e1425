"""The true surface, in the frame and unit of a run's scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Scene

if TYPE_CHECKING:
    from room2dgs.eval.protocol import MeshFile


def truth_in_scene(path: Path, scene: Scene) -> MeshFile:
    """A mesh of the capture's own world in the scene's frame, metres.

    It counts in the capture's unit, as the poses: where that was estimated, it is scaled as they are.

    Raises:
        InputError: as `load`.
    """
    from room2dgs.eval.alignment import transformed_mesh
    from room2dgs.eval.protocol import load

    if scene.unit_m is None:
        return load(path, scene.origin_m)
    x, y, z = (value / scene.unit_m for value in scene.origin_m)
    found = load(path, (x, y, z))
    scale = np.diag([scene.unit_m, scene.unit_m, scene.unit_m, 1.0])
    return replace(found, mesh=transformed_mesh(found.mesh, scale))
