"""Results as JSON and as a table."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from room2dgs.errors import InputError
from room2dgs.files import whole_file

ROWS = (
    ("f_score_{at}", "F-score @ {at}"),
    ("precision_{at}", "precision @ {at}"),
    ("recall_{at}", "recall @ {at}"),
    ("accuracy_m", "accuracy"),
    ("completion_m", "completion"),
    ("chamfer_m", "chamfer"),
    ("normal_consistency", "normal consistency"),
)


def update_metrics(path: Path, part: dict[str, Any]) -> dict[str, Any]:
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


def table(protocols: dict[str, dict[str, Any]], threshold: str) -> str:
    """A table of protocols side by side.

    Args:
        protocols: name -> scores as in metrics.json.
        threshold: as in the keys, e.g. "5cm".
    """
    grid = Table(title="mesh against ground truth")
    grid.add_column("")
    for name in protocols:
        grid.add_column(name, justify="right")
    for key, label in ROWS:
        name = key.format(at=threshold)
        shown = (_shown(name, scores.get(name)) for scores in protocols.values())
        grid.add_row(label.format(at=threshold), *shown)
    console = Console(width=40 + 14 * len(protocols), color_system=None, force_terminal=False)
    with console.capture() as captured:
        console.print(grid)
    return captured.get().rstrip("\n")


def _shown(key: str, value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value * 1000:.1f} mm" if key.endswith("_m") else f"{value:.3f}"


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
