"""Runs that differ by one part of the method, gathered into rows: means and spreads over random seeds."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from room2dgs.eval.error_sites import far_share
from room2dgs.eval.geometry_scores import threshold_name

FULL = "full"
FINE, FINEST = "f_score_2cm", "f_score_1cm"
# of `mesh_quality`
WHOLE = ("tears_per_m", "coverage_known", "roughness_2cm_deg", "roughness_10cm_deg", "in_free_space")
FAR_OFF = "far_off"
NEAR_DEPTH = "depth_within_5cm"
SCORING = ("texture", "export", "render", "eval", "report")  # stages that make no mesh


@dataclass(frozen=True)
class Run:
    """One run of a study.

    Attributes:
        row: the row of the table that it belongs to.
        seed: its random seed.
        folder: where its mesh is.
        metrics: its metrics.json; None if it did not finish.
        failed: why it did not.
        same_as: the row whose run this is too, because all settings are the same.
    """

    row: str
    seed: int
    folder: Path
    metrics: Mapping[str, Any] | None = None
    failed: str = ""
    same_as: str = ""


@dataclass(frozen=True)
class Value:
    """A figure over the runs of a row: mean, and sample standard deviation (None of a single run)."""

    mean: float
    spread: float | None = None


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        words: what was removed or changed, in words.
        values: figure's name -> value over the finished runs; only what they have.
        stages: stage of the training -> mean seconds.
        runs: all of them, finished or not.
    """

    name: str
    words: str
    values: dict[str, Value]
    stages: dict[str, float]
    runs: tuple[Run, ...]

    @property
    def finished(self) -> tuple[Run, ...]:
        return tuple(run for run in self.runs if run.metrics is not None)

    @property
    def same_as(self) -> str:
        return self.runs[0].same_as

    @property
    def priors(self) -> str:
        """What the maps were: none, files, simulated, ..."""
        return ", ".join(dict.fromkeys(str(run.metrics.get("priors", "none")) for run in self.finished if run.metrics))


@dataclass(frozen=True)
class Study:
    """A table of rows and what must be known to read it.

    Attributes:
        command: what was typed.
        threshold_m: of the leading F-score.
    """

    title: str
    command: str
    threshold_m: float
    rows: tuple[Row, ...]

    @property
    def at(self) -> str:
        """The threshold's name, e.g. "5cm"."""
        return threshold_name(self.threshold_m)

    @property
    def full(self) -> Row | None:
        """The row of the full model, if it has a finished run."""
        return next((row for row in self.rows if row.name == FULL and row.finished), None)

    @property
    def simulated(self) -> bool:
        """Whether any run used maps that were made from the ground truth."""
        return any("simulated" in row.priors for row in self.rows)


def rows_of(runs: Iterable[Run], words: Mapping[str, str], threshold_m: float) -> tuple[Row, ...]:
    """The table's rows in the order in which the runs name them.

    Args:
        words: row -> what was removed.
        threshold_m: of the leading F-score.
    """
    by_row: dict[str, list[Run]] = {}
    for run in runs:
        by_row.setdefault(run.row, []).append(run)
    at = threshold_name(threshold_m)
    return tuple(_row(name, words.get(name, ""), tuple(group), at) for name, group in by_row.items())


def difference(first: Row, second: Row, figure: str) -> Value | None:
    """First minus second; the spread is that of a difference of two independent runs. None if one has no figure."""
    a, b = first.values.get(figure), second.values.get(figure)
    if a is None or b is None:
        return None
    spread = None if a.spread is None or b.spread is None else math.hypot(a.spread, b.spread)
    return Value(a.mean - b.mean, spread)


def figures_of(metrics: Mapping[str, Any] | None, at: str) -> dict[str, float]:
    """The table's figures that a run's metrics.json has, by name.

    Args:
        at: name of the leading threshold, e.g. "5cm": figure "f_score" is at it, "f_score_2cm" always at 2 cm,
            "far_off" from four times it on.
    """
    metrics = metrics or {}
    seconds = metrics.get("seconds") or {}
    scores = (metrics.get("protocols") or {}).get(metrics.get("protocol"), {})
    found = {
        "accuracy_m": metrics.get("accuracy_m"),
        "completion_m": metrics.get("completion_m"),
        "precision": metrics.get(f"precision_{at}"),
        "recall": metrics.get(f"recall_{at}"),
        "f_score": metrics.get(f"f_score_{at}"),
        FINE: scores.get(FINE),
        FINEST: scores.get(FINEST),
        "normal_consistency": metrics.get("normal_consistency"),
        "chamfer_m": metrics.get("chamfer_m"),
        "psnr_db": metrics.get("psnr_db"),
        "stereo_coverage": metrics.get("stereo_coverage"),
        "primitives": metrics.get("primitives"),
        "points_s": seconds.get("points"),
        "priors_s": seconds.get("priors"),
        "train_s": seconds.get("train"),
        "mesh_s": seconds.get("mesh"),
        "peak_memory_mb": metrics.get("peak_memory_mb"),
    }
    quality = metrics.get("mesh_quality") or {}
    found |= {name: quality.get(name) for name in WHOLE}
    if depth := (metrics.get("depth_scores") or {}).get("mesh"):
        found[NEAR_DEPTH] = depth["all"].get("within_5cm")
    for name, stages in (("run_s", seconds), ("cpu_s", metrics.get("cpu_seconds") or {})):
        if stages:
            found[name] = sum(value for stage, value in stages.items() if stage not in SCORING)
    if metrics.get("where_the_error_sits"):
        found[FAR_OFF] = far_share(metrics["where_the_error_sits"])
    if seconds.get("train") is not None and seconds.get("mesh") is not None:
        found["train_and_mesh_s"] = seconds["train"] + seconds["mesh"]
    return {name: float(value) for name, value in found.items() if value is not None}


def _row(name: str, words: str, runs: tuple[Run, ...], at: str) -> Row:
    finished = [run.metrics for run in runs if run.metrics is not None]
    figures = _means(figures_of(metrics, at) for metrics in finished)
    stages = _means(metrics.get("training_seconds") or {} for metrics in finished)
    return Row(name, words, figures, {stage: value.mean for stage, value in stages.items()}, runs)


def _means(figures: Iterable[Mapping[str, float]]) -> dict[str, Value]:
    """Over the runs that have a figure."""
    numbers: dict[str, list[float]] = {}
    for one in figures:
        for name, number in one.items():
            numbers.setdefault(name, []).append(number)
    return {name: _value(group) for name, group in numbers.items()}


def _value(numbers: list[float]) -> Value:
    return Value(statistics.fmean(numbers), statistics.stdev(numbers) if len(numbers) > 1 else None)
