"""A mesh of the sparse points alone: normals from their neighbours, screened Poisson reconstruction, trimmed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import MeshConfig
from room2dgs.logs import Log
from room2dgs.mesh.finish import NoSurface, cleaned, finished
from room2dgs.mesh.open3d import o3d
from room2dgs.mesh.point_normals import oriented_normals, towards_views
from room2dgs.mesh.poisson import screened_poisson
from room2dgs.mesh.voxel import voxel_side
from room2dgs.sfm.capture_points import MIN_POINTS

MARGIN = 1.1  # of the octree's side to the points'; open3d's default
# Share of the vertices, those with the fewest points near: Poisson closes over whatever no point says anything of.
# Chosen on one room, bathroom: with less the surface bulges, with more it loses walls that have few points.
TRIMMED = 0.1


def surface_of_points(
    points: PointCloud, frames: Sequence[Frame], config: MeshConfig, log: Log = print
) -> trimesh.Trimesh:
    """The surface that sparse points lie on.

    Points that no view sees within mesh.max_depth_m are left out: nothing says which side of them is the front.

    Args:
        points: metres; without tracks, each view probably sees what projects into it and is not hidden.
        frames: the training views.
        config: `voxel_m` is a number (`voxel.with_voxel`).

    Returns:
        Mesh in the world frame, metres, with the points' colours, faces towards the cameras; the same bits each time.

    Raises:
        NoSurface: too few points, or all in one place, or nothing is left of the surface; says what to do.
    """
    towards = towards_views(points, frames, config.max_depth_m)
    seen = towards.any(axis=1)
    if int(seen.sum()) < MIN_POINTS:
        raise NoSurface(
            f"{int(seen.sum())} of {len(points)} sparse points are seen by photos at most "
            f"mesh.max_depth_m={config.max_depth_m:g} away, at least {MIN_POINTS} are needed for a surface; "
            "raise it, add sharp overlapping photos or give points of this room"
        )
    xyz, rgb = points.xyz[seen], points.rgb[seen]
    extent = float(np.ptp(xyz, axis=0).max())
    if extent < voxel_side(config):
        raise NoSurface(
            f"all {len(xyz)} sparse points lie within mesh.voxel_m={config.voxel_m:g} of each other; "
            "give points of a whole room"
        )
    middle = (xyz.min(axis=0) + xyz.max(axis=0)) / 2
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz - middle))
    cloud.normals = o3d.utility.Vector3dVector(oriented_normals(xyz - middle, towards[seen]))
    cloud.colors = o3d.utility.Vector3dVector(rgb / 255)
    raw = _trimmed(*screened_poisson(cloud, extent, voxel_side(config), MARGIN))
    if not len(raw.faces):
        raise NoSurface(f"no surface came out of {len(xyz)} sparse points; add photos of the same places")
    raw.vertices += middle
    log(f"mesh: screened Poisson reconstruction of {len(xyz):,} sparse points")
    return finished(cleaned(raw, config, log), config, log)


def _trimmed(surface: o3d.geometry.TriangleMesh, density: np.ndarray) -> trimesh.Trimesh:
    """Without the vertices that have the fewest points near, and their faces."""
    if len(density):
        surface.remove_vertices_by_mask(density < np.quantile(density, TRIMMED))
    return trimesh.Trimesh(
        vertices=np.asarray(surface.vertices),
        faces=np.asarray(surface.triangles),
        vertex_colors=np.round(np.clip(np.asarray(surface.vertex_colors), 0, 1) * 255).astype(np.uint8),
        process=False,
    )
