"""`room2dgs open`: the page of a run, in a browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError
from room2dgs.logs import to_terminal
from room2dgs.runs.folder import MESH, REPORT, earlier_run, last_value, required

USAGE = "room2dgs open RUN"


def main(argv: list[str]) -> int:
    """Show report.html of an earlier run in this machine's browser. Where there is none, its address is printed."""
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    run = last_value(argv, "run") or last_value(argv, "out")
    if not run or len(argv) > 1:
        raise InputError(f"say which run, and nothing else: {USAGE}")
    out = Path(earlier_run([f"out={run}"]).out)
    page = required(out / REPORT, "report")
    if _changed(out / MESH) > _changed(page):
        to_terminal(f"NOTE: the page is of an earlier mesh; room2dgs report {run} writes it anew")
    shown = webbrowser.open(page.as_uri())
    to_terminal(f"opened {page}" if shown else f"no browser was found here; open {page.as_uri()}")
    return 0


def _changed(path: Path) -> float:
    return path.stat().st_mtime if path.exists() else 0.0
