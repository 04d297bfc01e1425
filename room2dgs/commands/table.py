"""`room2dgs table`: runs, and meshes of other methods, in the columns of the paper's Table I."""

from __future__ import annotations

from pathlib import Path

from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError
from room2dgs.runs.folder import last_value

USAGE = "room2dgs table RUN... [out=table] [meshes=DIR] [protocol=NAME] [name=NAME]"
OWN = ("out", "meshes", "protocol", "name")


def main(argv: list[str]) -> int:
    """Write table.csv, table.md, table.html and table.tex of finished runs, with means over the scenes of each dataset.

    RUN is the folder of a run, or a folder of such (of a suite or a multirun). meshes=DIR has the meshes of other
    methods as DIR/METHOD/SCENE.ply, where SCENE is the name of a run's capture: they are scored as that run was, by its
    cameras against its truth. What was scored is kept in out/scores and not scored again; what fails is named, and
    the rest goes on. protocol= is the runs' first unless given. Runs of one capture that differ by their seed alone
    count as one, by their mean; others are rows of their own, called by their folders unless name= is given.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    unknown = next((text for text in argv if "=" in text and text.partition("=")[0] not in OWN), None)
    if unknown and not Path(unknown).exists():
        raise InputError(f"{unknown} is not known here; give runs, and of settings {', '.join(OWN)} alone")
    from room2dgs.study.score_runs import write_score_table

    meshes = last_value(argv, "meshes")
    scores = write_score_table(
        [text for text in argv if text.partition("=")[0] not in OWN],
        Path(last_value(argv, "out") or "table").expanduser().absolute(),
        protocol=last_value(argv, "protocol"),
        name=last_value(argv, "name"),
        meshes=Path(meshes).expanduser() if meshes else None,
    )
    return 2 if any(score.failed for score in scores) else 0
