"""Scores of several protocols side by side."""

from __future__ import annotations

from typing import Any

import pandas as pd

ROWS = (
    ("f_score_{at}", "F-score @ {at}"),
    ("precision_{at}", "precision @ {at}"),
    ("recall_{at}", "recall @ {at}"),
    ("accuracy_m", "accuracy"),
    ("completion_m", "completion"),
    ("chamfer_m", "chamfer"),
    ("normal_consistency", "normal consistency"),
)


def table(protocols: dict[str, dict[str, Any]], threshold: str) -> str:
    """A table for a terminal, a column for each protocol.

    Args:
        protocols: name -> scores as in metrics.json.
        threshold: as in the keys, e.g. "5cm".
    """
    keys = {key.format(at=threshold): label.format(at=threshold) for key, label in ROWS}
    columns = {name: [_shown(key, scores.get(key)) for key in keys] for name, scores in protocols.items()}
    frame = pd.DataFrame(columns, index=pd.Index(keys.values(), name="mesh against ground truth"))
    align = ("left", *("right" for _ in columns))
    return frame.to_markdown(tablefmt="simple_outline", disable_numparse=True, colalign=align)


def _shown(key: str, value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value * 1000:.1f} mm" if key.endswith("_m") else f"{value:.3f}"
