"""The open boundary of a run's mesh by what lies beyond it: boundary.ply, and metres by kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from room2dgs.captures.scene import Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.depth_coverage import SURE
from room2dgs.runs.folder import BOUNDARY
from room2dgs.runs.mirrors import trusted_depths

if TYPE_CHECKING:
    import trimesh

    from room2dgs.eval.boundary_kinds import JudgedBoundary


def write_mesh_boundary(mesh: trimesh.Trimesh, scene: Scene, run: RunFolder) -> dict[str, Any]:
    """boundary.ply of a mesh in the scene's frame.

    Returns:
        For metrics.json: "boundary_m", kind -> metres; None, and no file, where the run trusts no depth.

    Raises:
        InputError: a photo's mask cannot be read.
    """
    from room2dgs.eval.boundary_kinds import COLORS, WORDS
    from room2dgs.mesh.boundary_file import BoundaryEdges, write_boundary

    path = run.path / BOUNDARY
    path.unlink(missing_ok=True)  # of the mesh before
    found = judged_boundary(mesh, scene, run)
    if found is None:
        return {"boundary_m": None}
    write_boundary(path, BoundaryEdges(found.boundary.ends, found.kind), COLORS, scene.origin_m)
    metres = found.metres
    said = ", ".join(f"{length:.1f} m {words}" for words, length in zip(WORDS, metres.values(), strict=True))
    run.log(f"mesh: its boundary: {said}")
    return {"boundary_m": metres}


def judged_boundary(mesh: trimesh.Trimesh, scene: Scene, run: RunFolder) -> JudgedBoundary | None:
    """By the depth that the run trusts, of as many training views as judge a mesh; None where it trusts none."""
    from room2dgs.eval.boundary import open_boundary
    from room2dgs.eval.boundary_kinds import judged
    from room2dgs.eval.mesh_quality import MOST_VIEWS
    from room2dgs.eval.sightlines import sightlines
    from room2dgs.eval.surface import Surface

    trust = trusted_depths(run.path, scene)
    if not any(one.depth is not None for one in trust.values()):
        return None
    surface = Surface(mesh)
    views = []
    for frame in evenly_spaced(scene.train, MOST_VIEWS):
        depths = (trust[frame.name].sure_depth(SURE),) if frame.name in trust else ()
        views.append(sightlines(frame.camera, surface, depths, frame.mask()))
    return judged(open_boundary(np.asarray(mesh.vertices, np.float64), surface.faces), views)
