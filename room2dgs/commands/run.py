"""`room2dgs run`: the main job, from photos to a scored mesh."""

from __future__ import annotations

import sys
from pathlib import Path

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.short_keys import FOOTAGE, with_full_keys
from room2dgs.errors import InputError
from room2dgs.logs import to_terminal
from room2dgs.runs.folder import CONFIG, last_value, saved_settings
from room2dgs.texts import shown

USAGE = (
    "room2dgs run DIR out=DIR [resume=true] [log=full] [KEY=VALUE ...]\n"
    "room2dgs run video=FILE|images=DIR out=DIR [resume=true] [KEY=VALUE ...]\n"
    "room2dgs run -m scene.path=DIR,DIR out=DIR [hydra/launcher=joblib] [KEY=VALUE,VALUE ...]"
)
VERDICT_FAILED = 3  # exit code with strict=true
LOGS = ("full", "line")
LAST_LINES = 3
MULTIRUN = ("-m", "--multirun")
WHAT = """Points, training, mesh, renders of the held-out views, scores if there is a ground truth, a verdict and
    a report.

    With -m every combination of settings that are lists is a run of its own, in out/0, out/1, ...: Hydra's multirun,
    with Hydra's sweepers and launchers. A path with a comma in its name then stands in quotes.

    On a terminal one line says how far the whole run is and how long it will still take; log.txt in the run's folder
    has the details, and log=full prints them too. Elsewhere they are printed unless log=line is given.

    Of a video, or of photos without poses, a capture is made first, in out/capture: see `room2dgs prepare --help`.
    """


def main(argv: list[str]) -> int:
    """Run all steps; see `WHAT`."""
    if asked_for_help(argv):
        return show(argv, USAGE, WHAT)
    if any(text in MULTIRUN for text in argv):
        return _run_all([text for text in argv if text not in MULTIRUN])
    own, rest = own_arguments(argv, ("log",))
    how = own.get("log") or ("line" if sys.stdout.isatty() else "full")
    if how not in LOGS:
        raise InputError(f"log={how} is not known; choose from {', '.join(LOGS)}")
    overrides = with_full_keys(rest, FOOTAGE)
    return _strict_code(_run_in_a_line(overrides) if how == "line" else _run_in_full(overrides))


def _run_in_full(overrides: list[str]) -> Path:
    from room2dgs.pipeline.reconstruct import start_run

    return start_run(overrides)


def _run_in_a_line(overrides: list[str]) -> Path:
    """One line says how far the run is; the log has the rest, and the last three lines are printed."""
    from room2dgs.commands.progress_line import ProgressLine
    from room2dgs.pipeline.progress import Progress

    progress = Progress()
    with ProgressLine(progress) as line:
        from room2dgs.pipeline.reconstruct import start_run  # torch takes seconds to import
        from room2dgs.pipeline.summary import summary

        out = start_run(overrides, line.log, progress)
    for text in summary(out)[-LAST_LINES:]:
        to_terminal(text)
    return out


def _strict_code(out: Path) -> int:
    """The exit code of a finished run; a strict one that failed says so where errors are read."""
    from room2dgs.runs.metrics import read_metrics
    from room2dgs.runs.verdict import noted_verdict

    verdict = noted_verdict(read_metrics(out))
    if verdict is None or not verdict.failed or not saved_settings(out).strict:
        return 0
    print(f"room2dgs: the verdict on {shown(str(out))} is failed: {shown(verdict.reasons[0])}", file=sys.stderr)
    return VERDICT_FAILED


def _run_all(overrides: list[str]) -> int:
    """A run for each combination of values."""
    from room2dgs.study.launch import multirun

    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR, in which each run gets a folder of its own")
    folder = Path(out).expanduser().absolute()
    if (folder / CONFIG).exists():
        raise InputError(f"{folder} holds a run; choose another out=DIR for several")
    multirun([text for text in overrides if not text.startswith("out=")], folder)
    return 0
