"""Leaves out single bad items by name, up to a share of all; more of them are an error."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from room2dgs.captures.capture import Shot
from room2dgs.errors import InputError
from room2dgs.regular_files import refusal
from room2dgs.texts import shown_name

MOST_MISSING = 0.5  # of the photos that a capture names; some are published so, thinned out on purpose
MOST_DAMAGED = 0.05  # of the photos, poses or masks; one is always borne
NAMED = 3


def left_out(bad: Mapping[str, str], of: int, what: str, most: float = MOST_DAMAGED) -> str | None:
    """What a person is told of items that cannot be used; None: there are none.

    Args:
        bad: name -> the sentence that says why it cannot be used.
        of: how many items there are, good and bad.
        what: the items in the plural, with what is wrong ("photos that are missing").
        most: share of the items that may be bad; one may always be.

    Raises:
        InputError: more are bad than may be; the first one's sentence, and how many there are.
    """
    if not bad:
        return None
    first = next(iter(bad.values()))
    if len(bad) > max(1.0, most * of):
        raise InputError(first if len(bad) == 1 else f"{first} (the first of {len(bad)} {what}, of {of})")
    return f"left out: {what} ({len(bad)} of {of}): {some(bad)}"


def some(names: Sequence[str] | Mapping[str, str]) -> str:
    """The first names, and how many more there are."""
    names = list(names)
    rest = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(map(shown_name, names[:NAMED])) + rest


def missing_photos(shots: Sequence[Shot]) -> dict[str, str]:
    """Names of the shots whose photo is to be a file of its own and is not there -> the sentence that says so."""
    return {
        shot.name: str(refusal(shot.path, error, "put it there or delete the frame"))
        for shot in shots
        if shot.photo is None and (error := absence(shot.path)) is not None
    }


def absence(path: Path) -> OSError | ValueError | None:
    """Why there is no file of this name; None: there is something, which may be unreadable."""
    try:
        os.stat(path)
    except PermissionError:
        return None
    except (OSError, ValueError) as error:
        return error
    return None
