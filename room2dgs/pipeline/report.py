"""A run on one page: report.html."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.exposure import with_noted_exposure
from room2dgs.pipeline.room_facts import room_facts
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import render_frames, use_threads
from room2dgs.runs.folder import MESH, required

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats
    from room2dgs.runs.page.views import Rendered

LARGE_MB = 15


def write_run_report(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> Path:
    """report.html of what the run's folder holds so far; it opens without a network.

    Args:
        surfels: None: nothing was trained, and photos are compared with the mesh.

    Returns:
        Its path.

    Raises:
        InputError: no mesh in a run that trains nothing, or a damaged file.
    """
    from room2dgs.runs.page.write import write_report

    use_threads(config)
    scene = with_noted_exposure(scene, run.path)
    with run.timed("report"):
        draw = (
            _renders_of_mesh(scene, config, run.path)
            if surfels is None
            else partial(render_frames, surfels, config=config)
        )
        facts, dimensions = room_facts(scene, surfels, config, run)
        path = write_report(scene, surfels, draw, config, run.path, facts, dimensions)
    size_mb = path.stat().st_size / 1e6
    run.record({"report_mb": round(size_mb, 2)})
    smaller = "; smaller with less of report.views, report.faces, report.max_surfels" if size_mb > LARGE_MB else ""
    run.log(f"report: {path} ({size_mb:.1f} MB{smaller})")
    return path


def _renders_of_mesh(scene: Scene, config: Config, out: Path) -> Rendered:
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.runs.page.mesh_views import mesh_rendered

    mesh = read_in_scene(required(out / MESH, "mesh"), scene.origin_m)
    red, green, blue = config.render.background
    return partial(mesh_rendered, mesh, background=(red, green, blue))
