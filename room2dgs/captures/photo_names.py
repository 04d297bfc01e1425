"""Names of files that belong to photos: a frame's unique name, or a photo's stem where that is unique."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path, PurePath

from room2dgs.errors import InputError

MOST_PHOTOS = 200_000  # of a capture; files that name more are damaged, or made to fill memory


def check_count(count: int, source: object) -> None:
    """Refuse more photos than a capture can have, before anything is made of each.

    Raises:
        InputError: there are more than `MOST_PHOTOS`.
    """
    if count > MOST_PHOTOS:
        raise InputError(f"{source} names {count:,} photos, more than the {MOST_PHOTOS:,} that are read; thin them out")


def shared_stems(photos: Iterable[str | PurePath]) -> frozenset[str]:
    """File names without their ending that more than one of some photos has: left/0000.jpg and right/0000.jpg."""
    counts = Counter(PurePath(photo).stem for photo in dict.fromkeys(map(str, photos)))
    return frozenset(stem for stem, count in counts.items() if count > 1)


def in_folder(folder: Path, most_folders: int = 1000) -> list[str]:
    """Names of the files in a folder and below it, relative to it, with slashes; a folder that links lead back to
    counts once.
    """
    found: list[str] = []
    left = [""]
    seen: set[str] = set()
    for _ in range(most_folders):
        if not left:
            break
        start = left.pop()
        real = os.path.realpath(folder / start)
        if real in seen:
            continue
        seen.add(real)
        for path in sorted((folder / start).iterdir()):
            if not path.name.startswith("."):
                (left if path.is_dir() else found).append(f"{start}/{path.name}" if start else path.name)
    return found
