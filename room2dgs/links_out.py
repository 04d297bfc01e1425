"""Refuses to write into folders with links that lead out of them.

Through a link, what is meant for a run's folder would land elsewhere; a pipe would be waited for.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from room2dgs.errors import InputError
from room2dgs.regular_files import not_regular

CAPTURES = frozenset({"capture"})  # photos of the user's, which may be links; they are read alone


def refuse_links_out(folder: Path, only: Collection[str] = ()) -> None:
    """Looks at everything below a run's folder before anything is written there; links inside of it are fine.

    The folder itself may be a link, and need not be there yet.

    Args:
        only: what is written to, where the folder may hold other things of the user's; empty: all of it.

    Raises:
        InputError: a link leads out of the folder, to nothing or to itself, or there is a pipe, a device or a socket;
            names the first one.
    """
    home = os.path.realpath(folder)
    pending = [home]
    while pending:
        place = pending.pop()
        try:
            with os.scandir(place) as found:
                entries = sorted(found, key=lambda one: one.name)
        except OSError:  # not there yet, or not to be read: whoever writes there will say so
            continue
        for one in entries:
            if only and place == home and one.name not in only:
                continue
            if one.is_symlink():
                _refuse_out(home, folder, one.path)
            elif one.is_dir(follow_symlinks=False):
                if place != home or one.name not in CAPTURES:
                    pending.append(one.path)
            elif not one.is_file(follow_symlinks=False):
                _refuse_kind(home, folder, one)


def _refuse_kind(home: str, folder: Path, one: os.DirEntry) -> None:
    try:
        kind = not_regular(one.stat(follow_symlinks=False).st_mode)
    except OSError:  # gone by now
        return
    if kind:
        raise InputError(f"{_shown(home, folder, one.path)} is {kind} where files and folders belong; delete it")


def _refuse_out(home: str, folder: Path, link: str) -> None:
    target = os.path.realpath(link)
    if os.path.exists(target) and os.path.commonpath([home, target]) == home:
        return
    raise InputError(
        f"{_shown(home, folder, link)} is a link to {os.readlink(link)}, out of the folder that is written to; "
        "remove the link, or put what it leads to in its place"
    )


def _shown(home: str, folder: Path, path: str) -> Path:
    """As the folder was named."""
    return Path(folder) / os.path.relpath(path, home)
