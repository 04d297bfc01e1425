"""`room2dgs report`: a run on one page."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import read, rendered, trained_surfels, use_threads, with_poses_of_run
from room2dgs.config import Config
from room2dgs.logs import Log, run_log
from room2dgs.runs.folder import MESH, at_work, earlier_run, required
from room2dgs.runs.metrics import record, timed

if TYPE_CHECKING:
    from room2dgs.runs.page.views import Rendered
    from room2dgs.splat.types import Surfels

LARGE_MB = 15
USAGE = "room2dgs report run=DIR [report.KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Write report.html of an earlier run again, with other settings if wanted. It opens without a network."""
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("report",))
    config = earlier_run(argv)
    with at_work(config) as out:
        surfels = trained_surfels(out) if config.mesh.of_surfels else None
        report_scene(with_poses_of_run(read(config), out), surfels, config, out, run_log(out), {})
    return 0


def report_scene(
    scene: Scene, surfels: Surfels | None, config: Config, out: Path, log: Log, seconds: dict[str, float]
) -> None:
    """report.html of what the run's folder holds so far.

    Args:
        surfels: None: nothing was trained, and photos are compared with the mesh.
    """
    from room2dgs.runs.page.write import write_report

    use_threads(config)
    with timed(seconds, "report"):
        draw = _of_mesh(scene, config, out) if surfels is None else partial(rendered, surfels, config=config)
        path = write_report(scene, surfels, draw, config, out)
    size_mb = path.stat().st_size / 1e6
    record(out, {"report_mb": round(size_mb, 2)}, seconds)
    smaller = "; smaller with less of report.views, report.faces, report.discs" if size_mb > LARGE_MB else ""
    log(f"report: {path} ({size_mb:.1f} MB{smaller})")


def _of_mesh(scene: Scene, config: Config, out: Path) -> Rendered:
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.runs.page.mesh_views import mesh_rendered

    mesh = read_in_scene(required(out / MESH, "mesh"), scene.origin_m)
    return partial(mesh_rendered, mesh, background=tuple(config.render.background))
