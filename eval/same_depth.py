"""Whether a ground truth was made from the depth maps that a run used: then its scores say little about photos."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from room2dgs.config import MeshConfig
from room2dgs.eval.protocol import MeshFile
from room2dgs.mesh.tsdf import Fusion, integrate
from room2dgs.mesh.views import FusedView

# Median distance: below it nobody can tell the truth from the depth. Real sensors are this far from a laser's truth or
# farther; the depth of which a truth was fused is nearer (redkitchen: 3.4 mm), exact depth much nearer (0.2 mm).
SAME_M = 0.005
VOXEL_M = 0.02
MOST_VERTICES = 100_000


def distance_to_truth(views: Iterable[FusedView], gt: MeshFile, config: MeshConfig) -> float:
    """Median distance of the fused depth maps from the true surface, metres; infinite if they fuse to nothing.

    Args:
        views: depth maps, metres; some dozens are enough.
        gt: the ground truth.
        config: of the run's mesh; only `max_depth_m` counts.
    """
    fused = integrate(views, Fusion(VOXEL_M, 4.0, config.max_depth_m, 2.0))
    vertices = np.asarray(fused.vertices, dtype=np.float64)
    if not len(vertices):
        return float("inf")
    some = vertices[:: max(1, len(vertices) // MOST_VERTICES)]
    return float(np.median(gt.surface.closest(some)[0]))
