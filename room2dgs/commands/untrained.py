"""What runs that train nothing have in common: a mesh by other means, its figures, and points without any prior."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.commands.stages import points_of_run
from room2dgs.commands.units import unit_named
from room2dgs.config import Config, MeshConfig
from room2dgs.logs import Log
from room2dgs.runs.folder import MESH
from room2dgs.runs.metrics import MESH_SCORES, record, stale, timed

if TYPE_CHECKING:
    import trimesh


def points_alone(
    scene: Scene, config: Config, out: Path, log: Log, seconds: dict[str, float], depth_source: str
) -> PointCloud:
    """The sparse points of a run that reads no priors; metrics.json says so.

    Args:
        depth_source: for metrics.json.

    Raises:
        InputError: as `sparse_points`.
    """
    log(f"{len(scene.train)} training views, {len(scene.test)} held out; no priors (mesh.source={config.mesh.source})")
    points = points_of_run(scene, config, out, log, seconds, instead="mesh.source=depth prior=room_prior")
    part = {"points": len(points), "priors": "none", "depth_source": depth_source, "prior_networks": {}}
    record(out, {**part, "stereo_coverage": None}, seconds)
    return points


def untrained_mesh(
    make: Callable[[MeshConfig], trimesh.Trimesh],
    what: str,
    scene: Scene,
    config: Config,
    out: Path,
    log: Log,
    seconds: dict[str, float],
) -> None:
    """mesh.ply, its figures into metrics.json.

    Args:
        make: from the settings with the voxels that the photos call for to the mesh.
        what: it is made of, for the log.

    Raises:
        InputError: as `make`.
    """
    from room2dgs.mesh.voxel import with_voxel
    from room2dgs.mesh.world import write_in_world

    settings = with_voxel(config.mesh, [frame.camera for frame in scene.train])
    with timed(seconds, "mesh"):
        with unit_named(scene, config, out):
            mesh = make(settings)
        write_in_world(out / MESH, mesh, scene.origin_m)
    made = {"mesh_vertices": len(mesh.vertices), "mesh_faces": len(mesh.faces), "mesh_voxel_m": settings.voxel_m}
    record(out, {**stale(out, MESH_SCORES), **made}, seconds)
    log(f"mesh: {out / MESH}, of {what} alone: nothing was trained")
