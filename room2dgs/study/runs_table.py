"""`python -m room2dgs.study.runs_table RUN...`: finished runs as rows of a Markdown table."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pandas as pd

from room2dgs.errors import InputError
from room2dgs.report.table import Table
from room2dgs.report.table import markdown as as_markdown
from room2dgs.runs.folder import METRICS
from room2dgs.runs.metrics import read_metrics

COLUMNS = {
    "run": lambda m: m["run"],
    "iterations": lambda m: str(m["iterations"]),
    "F @ 5 cm": lambda m: f"{m['f_score_5cm']:.3f}",
    "F @ 2 cm": lambda m: f"{m['protocols'][m['protocol']]['f_score_2cm']:.3f}",
    "precision": lambda m: f"{m['precision_5cm']:.3f}",
    "recall": lambda m: f"{m['recall_5cm']:.3f}",
    "accuracy": lambda m: f"{100 * m['accuracy_m']:.1f} cm",
    "completion": lambda m: f"{100 * m['completion_m']:.1f} cm",
    "PSNR": lambda m: f"{m['psnr_db']:.1f} dB",
    "SSIM": lambda m: f"{m['ssim']:.3f}",
    "surfels": lambda m: f"{m['primitives']:,}",
    "points + train + mesh": lambda m: (
        " + ".join(f"{m['seconds'][stage] / 60:.1f}" for stage in ("points", "train", "mesh")) + " min"
    ),
    "memory": lambda m: f"{m['peak_memory_mb'] / 1000:.1f} GB",
}


def row(run: Path) -> dict[str, str]:
    """A run's cells by column.

    Raises:
        InputError: the folder holds no scored run.
    """
    path = run / METRICS
    try:
        metrics: dict[str, Any] = {**read_metrics(run), "run": run.name}
        return {name: cell(metrics) for name, cell in COLUMNS.items()}
    except (OSError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path} is not that of a scored run ({error}); run `room2dgs eval out={run}` first"
        ) from error


def markdown(runs: list[Path]) -> str:
    """All runs as a Markdown table."""
    return as_markdown(Table("", pd.DataFrame([row(run) for run in runs], columns=list(COLUMNS))))


def main(argv: list[str] | None = None) -> int:
    """Print the table; 2 if a folder cannot be used."""
    argv = sys.argv[1:] if argv is None else argv
    try:
        print(markdown([Path(a) for a in argv]))
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
