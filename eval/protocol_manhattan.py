"""Protocol `manhattan`: ManhattanSDF's and MonoSDF's ScanNet evaluation.

1. The prediction's depth is rendered at the evaluation poses and fused again (1 cm voxels, 3 cm truncation,
   5 m): this removes what no camera saw. The ground truth is taken as it stands.
2. Vertices of both, averaged in cells of 2 cm, nearest neighbours. So the scores depend on the tessellation.

Where it differs: rendered 640 wide, not 1296 (a pixel is under a voxel up to 5 m either way), at all usable
frames of the scene (the original takes every tenth of ScanNet's 30 a second), back faces are not culled, and the
fusion is this package's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from room2dgs.eval.protocol import MeshFile, Options, Result, by_vertex
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.clean import clean
from room2dgs.mesh.tsdf import Fusion, integrate
from room2dgs.mesh.views import FusedView

IMAGE_WIDTH = 640
VOXEL_M = 0.01
TRUNCATION_VOXELS = 3.0
MAX_DEPTH_M = 5.0
MIN_WEIGHT = 0.0  # a voxel seen once counts
DOWNSAMPLE_M = 0.02


def manhattan(pred: MeshFile, gt: MeshFile, cameras: Sequence[Camera], options: Options) -> Result:
    """Score by ManhattanSDF's protocol; of `options` only threshold_m is used."""
    fusion = Fusion(VOXEL_M, TRUNCATION_VOXELS, MAX_DEPTH_M, MIN_WEIGHT)
    fused = clean(integrate(_depth_views(pred.surface, cameras), fusion))
    constants = {
        "image_width": IMAGE_WIDTH,
        "voxel_m": VOXEL_M,
        "truncation_m": VOXEL_M * TRUNCATION_VOXELS,
        "max_depth_m": MAX_DEPTH_M,
        "min_weight": MIN_WEIGHT,
        "views": len(cameras),
    }
    vertices = fused.vertices, gt.mesh.vertices
    return by_vertex("manhattan", pred, gt, vertices, DOWNSAMPLE_M, options.threshold_m, constants)


def _depth_views(surface: Surface, cameras: Sequence[Camera]) -> Iterator[FusedView]:
    for camera in cameras:
        view = camera.resized_to_width(IMAGE_WIDTH)
        depth = surface.seen_by(view).t.reshape(view.height, view.width)
        depth = np.where(depth <= MAX_DEPTH_M, depth, 0).astype(np.float32)
        yield FusedView(view, depth, np.ones((*depth.shape, 3), dtype=np.float32))
