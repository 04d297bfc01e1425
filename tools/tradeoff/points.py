"""Score against time: the same captures under several settings, a row for each pair."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from room2dgs.errors import InputError
from room2dgs.eval.error_sites import far_m
from room2dgs.eval.geometry_scores import threshold_name
from room2dgs.files import whole_file
from room2dgs.report.csv_text import as_csv_text
from room2dgs.report.table import NOTHING, Table, markdown, table
from room2dgs.study import suite
from room2dgs.study.ablation import FAR_OFF, FINE, Row
from room2dgs.study.ablation_tables import shown
from room2dgs.study.jobs import Job
from room2dgs.tools.named_points import named_points

JSON, MARKDOWN = "tradeoff.json", "tradeoff.md"
SETS = Path(__file__).parent  # a YAML file of settings for each set of points
# heading -> figure
COLUMNS = {
    "F @ {at}": "f_score",
    "F @ 2cm": FINE,
    "precision": "precision",
    "recall": "recall",
    "over {far} off (%)": FAR_OFF,
    "stereo covers (%)": "stereo_coverage",
    "chamfer (cm)": "chamfer_m",
    "PSNR (dB)": "psnr_db",
    "seconds": "run_s",
    "CPU seconds": "cpu_s",
    "surfels": "primitives",
    "memory (GB)": "peak_memory_mb",
}


@dataclass(frozen=True)
class Tradeoff:
    """What was run so far and what must be known to read it.

    Attributes:
        command: what was typed.
        points: name -> its settings.
        threshold_m: of the leading F-score.
        machine: processor, cores, memory.
        rows: one a capture and point, named "capture, point".
    """

    command: str
    points: Mapping[str, Sequence[str]]
    threshold_m: float
    machine: Mapping[str, Any]
    rows: tuple[Row, ...]

    @property
    def at(self) -> str:
        """The threshold's name, e.g. "5cm"."""
        return threshold_name(self.threshold_m)

    def line(self, point: str) -> list[Row]:
        """A point's rows, a capture each."""
        return [row for row in self.rows if row.words == point]


def sets() -> list[str]:
    """Names of the sets of points that come with this tool."""
    return sorted(path.stem for path in SETS.glob("*.yaml"))


def points_of(argv: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Name -> settings, of points=SET, then of every point='NAME: KEY=VALUE ...'; of the presets if neither is given.

    Raises:
        InputError: as `named_points`, or no such set.
    """
    name = next((text.partition("=")[2] for text in reversed(argv) if text.startswith("points=")), None)
    if name is None:
        return named_points(argv) or _set("presets")
    if name not in sets():
        raise InputError(f"points={name} is not known; choose from {', '.join(sets())}, or give point='NAME: ...'")
    listed = _set(name)
    return listed | named_points(argv, reserved=listed)


def _set(name: str) -> dict[str, tuple[str, ...]]:
    listed = yaml.safe_load((SETS / f"{name}.yaml").read_text(encoding="utf-8"))
    return {str(point): tuple(shlex.split(settings)) for point, settings in listed.items()}


def planned(
    scenes: Sequence[str], points: Mapping[str, Sequence[str]], overrides: Sequence[str], out: Path
) -> list[Job]:
    """A run for each capture, point and seed, each in a folder of its own; a point's settings have the last word.

    Raises:
        InputError: settings that cannot be.
    """
    jobs = []
    for point, settings in points.items():
        folder = out / re.sub(r"[^\w.+-]+", "_", point)
        for job in suite.planned(scenes, [*overrides, *settings], folder):
            jobs.append(replace(job, row=f"{job.row}, {point}", experiment=point))
    return jobs


def score_table(found: Tradeoff) -> Table:
    """A line for each capture and point, then the means over the captures."""
    lines = [(row.name.removesuffix(f", {row.words}"), row.words, row.values, bool(row.finished)) for row in found.rows]
    for point in found.points:
        rows = [row for row in found.line(point) if row.finished]
        if len(rows) > 1:
            lines.append((f"mean of {len(rows)}", point, mean_values(rows), True))
    columns: dict[str, Callable[[Any], str]] = {
        "scene": lambda line: line[0] if line[3] else f"{line[0]} (not run)",
        "settings": lambda line: line[1],
    }
    for heading, figure in COLUMNS.items():
        columns[heading.format(at=found.at, far=f"{100 * far_m(found.threshold_m):g} cm")] = partial(
            lambda figure, line: shown(line[2].get(figure), figure), figure
        )
    return table("", columns, lines)


def mean_values(rows: Sequence[Row]) -> dict[str, Any]:
    """Figure -> mean over rows, of the figures that all of them have."""
    names = set.intersection(*(set(row.values) for row in rows))
    return {
        name: replace(rows[0].values[name], mean=sum(row.values[name].mean for row in rows) / len(rows), spread=None)
        for name in names
    }


def sentences(found: Tradeoff) -> list[str]:
    """What failed, and what must be known to read the table."""
    runs = [run for row in found.rows for run in row.runs]
    lines = [f"{run.row}, seed {run.seed}, failed: {run.failed}" for run in runs if run.failed]
    lines += [f"{point}: {' '.join(settings)}" for point, settings in found.points.items()]
    commits = sorted({str(run.metrics.get("commit")) for run in runs if run.metrics})
    lines.append(f"commit: {', '.join(commits) or NOTHING}")
    told = found.machine
    lines.append(f"machine: {told['processor']}, {told['cores']} cores, {told['memory_gb']} GB, {told['system']}")
    lines.append("seconds: of everything but scoring, exports and pictures; CPU seconds: of all cores together")
    return lines


def write_tables(found: Tradeoff, out: Path) -> str:
    """tradeoff.md, .csv and .json from what is finished so far; returns the Markdown."""
    scores = score_table(found)
    listed = "\n".join(f"- {line}" for line in sentences(found))
    text = f"# Score against time\n\n`{found.command}`\n\n{markdown(scores)}\n\n{listed}\n"
    whole = {
        "command": found.command,
        "points": {name: list(settings) for name, settings in found.points.items()},
        "threshold_m": found.threshold_m,
        "machine": dict(found.machine),
        "rows": [_row_as_json(row) for row in found.rows],
    }
    contents = {
        MARKDOWN: text,
        JSON: json.dumps(whole, indent=1) + "\n",
        "tradeoff.csv": as_csv_text(scores.frame),
    }
    for name, content in contents.items():
        with whole_file(out / name) as temporary:
            temporary.write_text(content, encoding="utf-8")
    return text


def _row_as_json(row: Row) -> dict[str, Any]:
    return {
        "name": row.name,
        "point": row.words,
        "values": {name: asdict(value) for name, value in row.values.items()},
        "runs": [{"seed": run.seed, "folder": str(run.folder), "failed": run.failed or None} for run in row.runs],
    }
