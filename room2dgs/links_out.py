"""A folder that is written to holds no link out of it: what is meant for a run's folder would land elsewhere."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from room2dgs.errors import InputError

CAPTURES = frozenset({"capture"})  # photos of the user's, which may be links; they are read alone


def refuse_links_out(folder: Path, only: Collection[str] = ()) -> None:
    """Looks at everything below a run's folder before anything is written there; links inside of it are fine.

    The folder itself may be a link, and need not be there yet.

    Args:
        only: what is written to, where the folder may hold other things of the user's; empty: all of it.

    Raises:
        InputError: a link leads out of the folder, to nothing or to itself; names the first one.
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
            elif one.is_dir(follow_symlinks=False) and not (place == home and one.name in CAPTURES):
                pending.append(one.path)


def _refuse_out(home: str, folder: Path, link: str) -> None:
    target = os.path.realpath(link)
    if os.path.exists(target) and os.path.commonpath([home, target]) == home:
        return
    shown = Path(folder) / os.path.relpath(link, home)
    raise InputError(
        f"{shown} is a link to {os.readlink(link)}, out of the folder that is written to; "
        "remove the link, or put what it leads to in its place"
    )
