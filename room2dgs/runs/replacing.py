"""Many files of a run's folder replaced together: all are the new ones in the end, or all are the old ones.

New files are made in a folder beside the old. A journal, written last, is the moment from which the new ones count:
whoever finds it finishes. Without it, what lies there is thrown away.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.json_files import read_json

PLACE = "scaling"  # in the run's folder
JOURNAL, LATER = "journal.json", "later.json"


def staging(out: Path) -> Path:
    """An empty folder for the new files, each with the name that it will have.

    Raises:
        OSError: the disk refuses.
    """
    place = out / PLACE
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    return place


def commit(out: Path, removed: Sequence[str], later: dict[str, Any]) -> None:
    """From here on the staged files are the run's; then they are put in their places.

    Args:
        removed: names of files and folders that are of the old ones, and go.
        later: what is still to be made when all are in place (`left`).
    """
    place = out / PLACE
    names = sorted(str(path.relative_to(place)) for path in place.rglob("*") if path.is_file())
    with whole_file(place / JOURNAL) as temporary:
        text = json.dumps({"files": names, "removed": list(removed), "later": later})
        temporary.write_text(text, encoding="utf-8")
    finish(out)


def unfinished(out: Path) -> bool:
    """Whether files are being replaced, and that was stopped."""
    return (out / PLACE / JOURNAL).is_file()


def refuse_unfinished(out: Path) -> None:
    """Raises InputError if some files of the folder are new and others old."""
    if unfinished(out):
        raise InputError(f"{out} is at two scales, as scaling it was stopped; finish with `room2dgs scale run={out}`")


def finish(out: Path) -> None:
    """Puts what was committed in its place; done twice it is the same.

    Raises:
        InputError: the journal is damaged.
    """
    place = out / PLACE
    if not unfinished(out):
        return
    journal = read_json(place / JOURNAL)
    for name in journal["removed"]:
        path = out / name
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    for name in journal["files"]:
        if (place / name).is_file():
            (out / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(place / name, out / name)
    note_left(out, journal["later"])
    (place / JOURNAL).unlink()


def left(out: Path) -> dict[str, Any]:
    """What is still to be made after a replacement; nothing if all is."""
    path = out / PLACE / LATER
    return read_json(path) if path.is_file() else {}


def note_left(out: Path, later: dict[str, Any]) -> None:
    """Keeps what is still to be made; the folder goes when nothing is."""
    if not later:
        shutil.rmtree(out / PLACE, ignore_errors=True)
        return
    with whole_file(out / PLACE / LATER) as temporary:
        temporary.write_text(json.dumps(later), encoding="utf-8")
