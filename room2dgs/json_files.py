"""Results as JSON files."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

from room2dgs.errors import InputError, first_line
from room2dgs.files import whole_file
from room2dgs.regular_files import read_regular

LONGEST = 64 << 20  # bytes; figures of ten thousand photos have some
MEND = "delete it"


def update_json(path: Path, part: dict[str, Any]) -> dict[str, Any]:
    """Set the top-level keys of `part` in a JSON file (made if missing), through a temporary file.

    Infinite and NaN numbers become null. Returns everything that the file now holds.

    Raises:
        InputError: the file is there but holds no JSON object.
    """
    path = Path(path)
    known = read_json(path) if os.path.lexists(path) else {}
    known.update(plain(part))
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(known, indent=2, allow_nan=False) + "\n")
    return known


def read_json(path: Path) -> dict[str, Any]:
    """The object that a JSON file holds.

    Raises:
        InputError: no regular file, too large, or no JSON object.
    """
    raw = read_regular(path, LONGEST, MEND)
    try:
        found = json.loads(raw, parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError) as error:  # JSON, UTF-8, digits without end; brackets without end
        raise InputError(f"{path} holds no JSON ({first_line(error)}); {MEND}") from error
    if not isinstance(found, dict):
        raise InputError(f"{path} holds no JSON object; {MEND}")
    return found


def plain(value: Any) -> Any:
    """What JSON can hold: infinite and NaN numbers are None, numpy's are Python's, paths are text."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "item") and not isinstance(value, str):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def _finite(word: str) -> float:
    number = float(word)
    if not math.isfinite(number):
        raise ValueError(f"{word} is no number of JSON")
    return number
