"""Settings that have a name on the command line: point='NAME: KEY=VALUE ...'."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sequence

from room2dgs.errors import InputError


def named_points(argv: Sequence[str], reserved: Collection[str] = ()) -> dict[str, tuple[str, ...]]:
    """Name -> settings, in the order given.

    Raises:
        InputError: one is not "NAME: KEY=VALUE ...", or its name is reserved or comes twice.
    """
    found: dict[str, tuple[str, ...]] = {}
    for text in (text.partition("=")[2] for text in argv if text.startswith("point=")):
        name, colon, settings = (part.strip() for part in text.partition(":"))
        try:
            overrides = tuple(shlex.split(settings))
        except ValueError:
            overrides = ()
        taken = name in found or name in reserved
        if not colon or not name or taken or not overrides or not all("=" in one for one in overrides):
            why = "that name is taken" if taken else "it is not understood"
            raise InputError(f"point={text!r}: {why}; write point='NAME: prior=room_prior KEY=VALUE ...'")
        found[name] = overrides
    return found
