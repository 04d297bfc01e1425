"""Reports keys of a file that a reader does not know, since they might change the geometry."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from room2dgs.captures.left_out import some
from room2dgs.errors import InputError

# numbers of a lens that bend rays, as programs call them
DISTORTION = frozenset(
    (
        *(f"k{i}" for i in range(1, 9)),
        *(f"p{i}" for i in range(1, 5)),
        *(f"b{i}" for i in range(1, 3)),
        *(f"s{i}" for i in range(1, 5)),
        *("distortion", "distortion_params", "distortion_coefficients", "distortion_coeffs", "dist_coeffs", "dist"),
        *("skew", "radial_distortion", "tangential_distortion", "D"),
    )
)


def unknown_keys(found: Iterable[object], known: Collection[str], path: object) -> str | None:
    """The note on keys that a reader does not know; None: it knows all.

    Args:
        found: of one object or of many, in the order in which they are to be named.
        known: what is read, and what is known to change nothing.
    """
    keys = {str(key): None for key in found if key not in known}
    if not keys:
        return None
    words = "a key" if len(keys) == 1 else f"{len(keys)} keys"
    return f"{path} has {words} that this layout does not know and that {_verb(keys)} not used: {some(list(keys))}"


def unknown_in(objects: Iterable[Any], known: Collection[str], path: object) -> str | None:
    """The same for the keys of many objects; what is no object has none."""
    return unknown_keys((key for one in objects if isinstance(one, Mapping) for key in one), known, path)


def check_no_distortion(found: Mapping[str, Any], path: object) -> None:
    """Refuse distortion in a layout whose photos are taken as a pinhole's.

    Raises:
        InputError: a number that bends rays is there and is not 0.
    """
    for key, value in found.items():
        if str(key).lower() in DISTORTION and not _zero(value):
            raise InputError(
                f"{path} has distortion ({some([str(key)])}), which is not read in this layout; undistort the photos "
                "and delete the key, or write the capture as transforms.json"
            )


def _zero(value: Any) -> bool:
    if isinstance(value, Mapping):
        return all(map(_zero, value.values()))
    try:
        return value is None or value in ("", "none", "None") or not np.any(np.array(value, np.float64))
    except (TypeError, ValueError):
        return False


def _verb(keys: Collection[str]) -> str:
    return "is" if len(keys) == 1 else "are"
