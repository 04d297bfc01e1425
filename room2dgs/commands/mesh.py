"""`room2dgs mesh`: a run's surfels to its mesh.ply."""

from __future__ import annotations

from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.errors import InputError
from room2dgs.pipeline.loaded_run import loaded_surfels
from room2dgs.pipeline.mesh import make_mesh
from room2dgs.pipeline.verdict import judge_run
from room2dgs.runs.folder import earlier_run, keep_settings
from room2dgs.runs.outdated import outdated

USAGE = "room2dgs mesh RUN [mesh.KEY=VALUE ...]"


def main(argv: list[str]) -> int:
    """Mesh an earlier run, with other settings than before if wanted."""
    if asked_for_help(argv):
        return show(argv, USAGE, main.__doc__, ("mesh",))
    config = earlier_run(argv)
    if not config.mesh.of_surfels:
        source = f"mesh.source={config.mesh.source}"
        raise InputError(f"{source} is a run of its own; type room2dgs run scene.path=DIR {source}")
    with loaded_surfels(config) as (scene, surfels, run):
        make_mesh(scene, surfels, config, run)
        verdict = judge_run(scene, config, run)
        keep_settings(run.path, config, "mesh")
        for line in (*verdict.lines(), *outdated(run.path, "mesh")):
            run.log(line)
        run.log(f"next: room2dgs eval out={run.path}")
    return 0
