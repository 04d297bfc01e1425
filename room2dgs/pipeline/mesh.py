"""The mesh of a run: mesh.ply, and mesh.glb with a picture on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.mesh_boundary import write_mesh_boundary
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import use_threads
from room2dgs.pipeline.texture import write_textured_mesh
from room2dgs.pipeline.units import unit_in_no_surface
from room2dgs.registries.meshers import MESHERS
from room2dgs.runs.folder import MESH, TEXTURED
from room2dgs.runs.metrics import MESH_SCORES, cleared
from room2dgs.runs.verdict import VERDICT

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats


def make_mesh(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> None:
    """mesh.ply by the mesher that mesh.source names, boundary.ply and mesh.glb of it (`write_textured_mesh`).

    Its figures go to metrics.json.

    A run that goes on keeps the mesh that it has if that was made of the same surfels with the same settings.

    Args:
        surfels: trained ones; None if the mesher trains nothing.

    Raises:
        InputError: no surface, or as the mesher.
    """
    from room2dgs.mesh.coloring.vertices import photo_colored
    from room2dgs.mesh.voxel import with_voxel
    from room2dgs.mesh.world import write_in_world
    from room2dgs.runs.kept_mesh import keep_mesh, mesh_is_kept, mesh_key

    mesher = MESHERS.get(config.mesh.source)
    use_threads(config)
    key = None if surfels is None else mesh_key(scene, config, run.path)
    if key and config.resume and mesh_is_kept(run.path, key):
        run.log(f"mesh: {run.path / MESH} is there from before")
        if not (run.path / TEXTURED).exists():
            write_textured_mesh(scene, surfels, config, run)
        return
    make = mesher.load()(scene, surfels, config, run)
    settings = with_voxel(config.mesh, [frame.camera for frame in scene.train])
    with run.timed("mesh"):
        with unit_in_no_surface(scene, config, run.path):
            mesh = make(settings)
        mesh, seen = photo_colored(mesh, scene.train)
        (run.path / TEXTURED).unlink(missing_ok=True)  # of the mesh before
        write_in_world(run.path / MESH, mesh, scene.origin_m)
        boundary = write_mesh_boundary(mesh, scene, run)
    # Scores and the verdict of a mesh that is no longer there must not stand beside this one.
    scores = cleared(run.path, MESH_SCORES)
    run.record(
        {
            **scores,
            **boundary,
            VERDICT: None,
            "mesh_vertices": len(mesh.vertices),
            "mesh_faces": len(mesh.faces),
            "mesh_voxel_m": settings.voxel_m,
        }
    )
    if key:
        keep_mesh(run.path, key)
    run.log(f"mesh: colours of {len(scene.train)} photos, which see {100 * seen:.0f}% of its vertices")
    made_of = f", of {mesher.facts['made_of']} alone: nothing was trained" if surfels is None else ""
    run.log(f"mesh: {run.path / MESH}{made_of}")
    write_textured_mesh(scene, surfels, config, run)
