"""Results as JSON files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from room2dgs.errors import InputError
from room2dgs.files import whole_file


def update_json(path: Path, part: dict[str, Any]) -> dict[str, Any]:
    """Set the top-level keys of `part` in a JSON file (made if missing), through a temporary file.

    Infinite and NaN numbers become null. Returns everything that the file now holds.

    Raises:
        InputError: the file is there but holds no JSON object.
    """
    path = Path(path)
    metrics: dict[str, Any] = {}
    if path.exists():
        try:
            metrics = json.loads(path.read_text())
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"{path} holds no JSON ({error}); delete it") from error
        if not isinstance(metrics, dict):
            raise InputError(f"{path} holds no JSON object; delete it")
    metrics.update(plain(part))
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(metrics, indent=2, allow_nan=False) + "\n")
    return metrics


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
