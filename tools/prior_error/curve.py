"""The mesh's score over the errors of the prior that it was made with: rows, what they say, files."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.eval.geometry_scores import threshold_name
from room2dgs.files import whole_file
from room2dgs.json_files import plain
from room2dgs.report.table import NOTHING, Table, markdown
from room2dgs.report.table import table as tabulated
from room2dgs.study.ablation import FINE, Row
from room2dgs.study.ablation_tables import SIMULATED, shown

JSON, MARKDOWN = "prior_error.json", "prior_error.md"
F_SCORE = "f_score"


@dataclass(frozen=True)
class Quality:
    """A prior's measured errors; None where it has no such map.

    Attributes:
        abs_rel, delta1: of depth, after each frame's scale and shift.
        normal_deg: mean angle (of the normals made of the depth if it has none of its own).
        frames: measured.
    """

    abs_rel: float | None
    delta1: float | None
    normal_deg: float | None
    frames: int


@dataclass(frozen=True)
class Point:
    """One prior and the runs with it.

    Attributes:
        kind: "none", "simulated", "noise" or "real".
        quality: None: not measured (yet), or no prior.
    """

    kind: str
    row: Row
    quality: Quality | None

    def error(self, name: str) -> float | None:
        """Its "abs_rel" or "normal_deg"."""
        return None if self.quality is None else getattr(self.quality, name)

    def score(self, name: str) -> float | None:
        """Mean over the finished runs; None without."""
        value = self.row.values.get(name)
        return None if value is None else value.mean


@dataclass(frozen=True)
class Curve:
    """All priors of a study.

    Attributes:
        command: what was typed.
        threshold_m: of the leading F-score.
    """

    title: str
    command: str
    threshold_m: float
    points: tuple[Point, ...]

    @property
    def at(self) -> str:
        return threshold_name(self.threshold_m)

    def of(self, *kinds: str) -> list[Point]:
        """The points of some kinds."""
        return [point for point in self.points if point.kind in kinds]

    def line(self, error: str, score: str) -> np.ndarray:
        """(N, 2) errors and scores of the simulated priors, by rising error."""
        pairs = [(point.error(error), point.score(score)) for point in self.of("simulated")]
        known = [(x, y) for x, y in pairs if x is not None and y is not None]
        return np.array(sorted(known), dtype=np.float64).reshape(-1, 2)


def write_tables(curve: Curve, out: Path) -> str:
    """prior_error.json and .md from what is finished so far; returns the Markdown."""
    parts = [f"# {curve.title}", f"`{curve.command}`", label(), markdown(table(curve))]
    text = "\n\n".join([*parts, "\n".join(f"- {line}" for line in sentences(curve))])
    with whole_file(out / JSON) as temporary:
        temporary.write_text(json.dumps(plain(as_json(curve)), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    with whole_file(out / MARKDOWN) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return text


def label() -> str:
    """What must be said of every such study."""
    return (
        f"**{SIMULATED}**: all rows named so, and the noise, use maps that were made from the ground truth; they show "
        "what a network of that quality would bring, no result of the pipeline on its own"
    )


def table(curve: Curve) -> Table:
    """Each prior's errors and what came of it."""
    columns: dict[str, Callable[[Point], str]] = {
        "prior": _name,
        "depth AbsRel": lambda point: _number(point.error("abs_rel"), "{:.3f}"),
        "δ1": lambda point: _number(point.error("delta1"), "{:.3f}"),
        "normals": lambda point: _number(point.error("normal_deg"), "{:.1f}°"),
    }
    figures = {
        f"F @ {curve.at}": F_SCORE, "F @ 2cm": FINE, "precision": "precision", "recall": "recall",
        "acc. (cm)": "accuracy_m", "comp. (cm)": "completion_m", "surfels": "primitives", "train (min)": "train_s",
    }  # fmt: skip
    for heading, figure in figures.items():
        columns[heading] = partial(lambda figure, point: shown(point.row.values.get(figure), figure), figure)
    seeds = sorted({run.seed for point in curve.points for run in point.row.runs})
    title = f"Scores by the prior's errors ({SIMULATED} but where a network is named)"
    title = f"{title}, seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))}"
    return tabulated(title, columns, curve.points)


def sentences(curve: Curve) -> list[str]:
    """What a better network would bring to each real prior, and what failed."""
    lines = []
    for point in curve.of("real"):
        degrees, score = point.error("normal_deg"), point.score(F_SCORE)
        if degrees is None or score is None:
            continue
        line = f"{point.row.name}: F @ {curve.at} {score:.3f} with normals {degrees:.1f}° off"
        same, half = (interpolated(curve.line("normal_deg", F_SCORE), x) for x in (degrees, degrees / 2))
        if same is not None:
            line += f"; simulated priors as far off have {same:.3f}"
        if half is not None:
            line += f", half as far off {half:.3f}"
        lines.append(line)
    none = next((point.score(F_SCORE) for point in curve.of("none")), None)
    if none is not None:
        lines.append(f"without a prior: F @ {curve.at} {none:.3f}")
    runs = [run for point in curve.points for run in point.row.runs]
    lines += [f"{run.row}, seed {run.seed}, failed: {run.failed}" for run in runs if run.failed]
    frames = {point.quality.frames for point in curve.points if point.quality}
    lines.append(
        f"errors: `room2dgs bench prior` on {', '.join(map(str, sorted(frames))) or 'no'} frames of the capture; depth "
        "after each frame's scale and shift"
    )
    return lines


def interpolated(line: np.ndarray, x: float) -> float | None:
    """The curve's height at x, linear between its points; None outside."""
    if len(line) < 2 or not line[0, 0] <= x <= line[-1, 0]:
        return None
    return float(np.interp(x, line[:, 0], line[:, 1]))


def as_json(curve: Curve) -> dict[str, Any]:
    """Everything that the table says, as plain values."""
    return {
        "title": curve.title,
        "command": curve.command,
        "threshold_m": curve.threshold_m,
        "points": [
            {
                "name": point.row.name,
                "kind": point.kind,
                "simulated": point.kind in ("simulated", "noise"),
                "quality": None if point.quality is None else asdict(point.quality),
                "values": {name: asdict(value) for name, value in point.row.values.items()},
                "runs": [
                    {"seed": run.seed, "folder": str(run.folder), "failed": run.failed or None}
                    for run in point.row.runs
                ],
            }
            for point in curve.points
        ],
    }


def _name(point: Point) -> str:
    done, of = len(point.row.finished), len(point.row.runs)
    name = f"{point.row.name} ({SIMULATED})" if point.kind == "noise" else point.row.name
    if done == of:
        return name
    state = "failed" if any(run.failed for run in point.row.runs) else "not run yet"
    return f"{name} ({f'{done} of {of} seeds' if done else state})"


def _number(value: float | None, form: str) -> str:
    return NOTHING if value is None else form.format(value)


def known(points: Sequence[Point], error: str, score: str) -> list[tuple[Point, float, float]]:
    """The points that have both, with them."""
    found = [(point, point.error(error), point.score(score)) for point in points]
    return [(point, x, y) for point, x, y in found if x is not None and y is not None]
