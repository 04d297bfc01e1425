"""What in a run's folder shows an earlier mesh or earlier surfels, and the commands that make it anew."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from room2dgs.registries.exporters import EXPORTERS, needs_of, place_of
from room2dgs.runs.folder import EXPORTS, MESH, RENDERS, REPORT, TEXTURED

SURFELS, PLAN, SCORES = "surfels", "plan", "eval"


def outdated(out: Path, part: str) -> list[str]:
    """Lines for the log; none where nothing is left of before.

    Args:
        out: the run's folder.
        part: what is new: "mesh" or "surfels".
    """
    found = list(_remains(out, part))
    if not found:
        return []
    names = ", ".join(name for name, _ in found)
    again = "; ".join(dict.fromkeys(command for _, command in found))
    return [f"of the {part} before are still: {names}", f"anew: {again}"]


def _remains(out: Path, part: str) -> Iterator[tuple[str, str]]:
    """Files and folders of before, and the command that makes each."""
    run = shlex.quote(str(out))
    if part == SURFELS:
        for name in (MESH, TEXTURED):
            if (out / name).is_file():
                yield name, f"room2dgs mesh {run}"
    if (out / SCORES).is_dir():
        yield f"{SCORES}/", f"room2dgs eval {run}"
    if part == SURFELS and (out / RENDERS).is_dir():
        yield f"{RENDERS}/", f"room2dgs render {run}"
    exports = [one for one in EXPORTERS.entries() if part in needs_of(one) and (out / EXPORTS / place_of(one)).exists()]
    names = ",".join(one.name for one in exports)
    for one in exports:
        yield f"{EXPORTS}/{place_of(one)}", f"room2dgs export {run} to={names}"
    if (out / PLAN).is_dir():
        yield f"{PLAN}/", f"room2dgs plan {run}"
    if (out / REPORT).is_file():
        yield REPORT, f"room2dgs report {run}"
