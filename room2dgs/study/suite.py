"""A suite of captures under the same settings: a run each, and means over the half that is tuned on and the other."""

from __future__ import annotations

import json
import os
import re
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from room2dgs.config import load_config
from room2dgs.config.overrides import quoted
from room2dgs.errors import InputError
from room2dgs.eval.geometry_scores import threshold_name
from room2dgs.files import whole_file
from room2dgs.report.table import NOTHING, Table, markdown, table
from room2dgs.runs.folder import POINTS, PRIOR_MAPS, absolute
from room2dgs.study.ablation import FINE, FINEST, NEAR_DEPTH, WHOLE, Row, Run, Value, figures_of, rows_of
from room2dgs.study.ablation_tables import shown
from room2dgs.study.jobs import SEED, Job, path_as_it_stands, swept_settings

MARKDOWN, JSON = "suite.md", "suite.json"
TUNE, REPORT, NEITHER = "tune", "report", ""
ALL = "all"
# heading -> figure
COLUMNS = {
    "F @ 1cm": FINEST,
    "F @ 2cm": FINE,
    "F @ {at}": "f_score",
    "precision": "precision",
    "recall": "recall",
    "chamfer (cm)": "chamfer_m",
    "normals": "normal_consistency",
    "tears (m/m²)": "tears_per_m",
    "covered (%)": "coverage_known",
    "rough at 2cm (°)": "roughness_2cm_deg",
    "rough at 10cm (°)": "roughness_10cm_deg",
    "in free space (%)": "in_free_space",
    "depth @ 5cm": NEAR_DEPTH,
    "seconds": "run_s",
    "surfels": "primitives",
    "memory (GB)": "peak_memory_mb",
}
# left out where no run has them: few are scored by protocol depth, and runs from before have no others
SOMETIMES = {FINEST, "normal_consistency", NEAR_DEPTH, *WHOLE}


@dataclass(frozen=True)
class Suite:
    """What was run so far and what must be known to read it.

    Attributes:
        command: what was typed.
        settings: those of every run.
        threshold_m: of the leading F-score.
        machine: processor, cores, memory.
        rows: one a capture.
    """

    command: str
    settings: tuple[str, ...]
    threshold_m: float
    machine: Mapping[str, Any]
    rows: tuple[Row, ...]

    @property
    def at(self) -> str:
        """The threshold's name, e.g. "5cm"."""
        return threshold_name(self.threshold_m)

    @property
    def commits(self) -> list[str]:
        """Those that made the runs."""
        runs = [run for row in self.rows for run in row.finished]
        return sorted({str(run.metrics.get("commit")) for run in runs if run.metrics})


def half_of(name: str) -> str:
    """`TUNE` for a capture with an even number at its name's end, `REPORT` for an odd one, else `NEITHER`."""
    number = re.search(r"\d+$", name)
    return NEITHER if number is None else (TUNE, REPORT)[int(number[0]) % 2]


def planned(scenes: Sequence[str], overrides: Sequence[str], out: Path) -> list[Job]:
    """A run for each capture and seed, each in a folder of its own; every capture has run once before one has twice.

    Photos alone count, unless a setting says otherwise: a capture's depth is what its truth was made with.

    Args:
        scenes: folders of captures.
        overrides: settings of every run, without `out` and `resume`; `train.seed` may be a list.

    Raises:
        InputError: settings that cannot be, or another list.
    """
    fixed = next((text for text in overrides if text.startswith("scene.path=")), None)
    if fixed:
        raise InputError(f"{fixed} is not understood here; name the captures without a key")
    several, swept = swept_settings([f"{SEED}=0", "prior=room_prior", *overrides])
    other = next((key for key in swept if key != SEED), None)
    if other:
        raise InputError(f"{other} is a list; give one value, only {SEED} may have several")
    return [_job(name, path, given, out) for given in several for name, path in zip(names(scenes), scenes, strict=True)]


def names(scenes: Sequence[str]) -> list[str]:
    """What the captures are called: their folders, with those above where that is not enough.

    Raises:
        InputError: a capture comes twice.
    """
    paths = [Path(os.path.abspath(Path(scene).expanduser())) for scene in scenes]
    twice = next((path for index, path in enumerate(paths) if path in paths[:index]), None)
    if twice:
        raise InputError(f"{twice} is given twice; name each capture once")
    last = [path.name for path in paths]
    return [name if last.count(name) == 1 else "_".join(path.parts[1:]) for name, path in zip(last, paths, strict=True)]


def rows_so_far(runs: Sequence[Run], threshold_m: float) -> tuple[Row, ...]:
    """The table's rows, with the seconds of whole runs, scoring aside."""
    return rows_of(runs, {run.row: half_of(run.row) for run in runs}, threshold_m)


def means(suite: Suite) -> dict[str, dict[str, Value]]:
    """Half -> figure -> mean over its finished captures, and over all of them; only halves that have one."""
    found: dict[str, dict[str, Value]] = {}
    for half in (TUNE, REPORT, ALL):
        values = [row.values for row in suite.rows if row.finished and half in (ALL, row.words)]
        if values:
            numbers = {name: [one[name].mean for one in values if name in one] for name in COLUMNS.values()}
            found[half] = {name: Value(statistics.fmean(known)) for name, known in numbers.items() if known}
    return found


def score_table(suite: Suite) -> Table:
    """A line for each capture, then the means."""
    lines = [(_name(row), row.words or NOTHING, row.values) for row in suite.rows]
    for half, values in means(suite).items():
        among = [row for row in suite.rows if half in (ALL, row.words)]
        done = sum(bool(row.finished) for row in among)
        share = "" if done == len(among) else f" {done} of"
        lines.append((f"mean of{share} {len(among)}", half, values))
    columns = {"scene": lambda line: line[0], "half": lambda line: line[1]}
    for heading, figure in COLUMNS.items():
        if figure in SOMETIMES and not any(figure in line[2] for line in lines):
            continue
        columns[heading.format(at=suite.at)] = partial(lambda figure, line: shown(line[2].get(figure), figure), figure)
    return table("", columns, lines)


def sentences(suite: Suite) -> list[str]:
    """What failed, and what must be known to read the table."""
    runs = [run for row in suite.rows for run in row.runs]
    lines = [f"{run.row}, seed {run.seed}, failed: {run.failed}" for run in runs if run.failed]
    unscored = [row.name for row in suite.rows if row.finished and "f_score" not in row.values]
    lines += [f"{name} has no ground truth to score against" for name in unscored]
    lines.append("settings: " + (" ".join(suite.settings) or "the defaults"))
    lines.append(f"commit: {', '.join(suite.commits) or NOTHING}")
    told = suite.machine
    lines.append(f"machine: {told['processor']}, {told['cores']} cores, {told['memory_gb']} GB, {told['system']}")
    lines.append(
        "seconds: of everything but scoring; settings are chosen on the half named tune, and told on the other"
    )
    return lines


def write_tables(suite: Suite, out: Path) -> str:
    """suite.md and suite.json from what is finished so far; returns the Markdown."""
    listed = "\n".join(f"- {line}" for line in sentences(suite))
    text = (
        f"# A suite of {len(suite.rows)} captures\n\n`{suite.command}`\n\n{markdown(score_table(suite))}\n\n{listed}\n"
    )
    with whole_file(out / MARKDOWN) as temporary:
        temporary.write_text(text, encoding="utf-8")
    with whole_file(out / JSON) as temporary:
        temporary.write_text(json.dumps(as_json(suite), indent=2) + "\n", encoding="utf-8")
    return text


def as_json(suite: Suite) -> dict[str, Any]:
    """Everything that the table says, as plain values."""
    return {
        "command": suite.command,
        "settings": list(suite.settings),
        "threshold_m": suite.threshold_m,
        "machine": dict(suite.machine),
        "commits": suite.commits,
        "rows": [
            {
                "name": row.name,
                "half": row.words or None,
                "values": {name: asdict(value) for name, value in row.values.items()},
                "runs": [
                    {
                        "seed": run.seed,
                        "folder": str(run.folder),
                        "failed": run.failed or None,
                        "values": figures_of(run.metrics, suite.at),
                    }
                    for run in row.runs
                ],
            }
            for row in suite.rows
        ],
        "means": {half: {name: value.mean for name, value in values.items()} for half, values in means(suite).items()},
    }


def _job(name: str, path: str, given: Mapping[str, str], out: Path) -> Job:
    folder = out / name / f"seed_{given[SEED]}"
    caches = {"points.cache": out / name / POINTS, "prior.cache": out / name / PRIOR_MAPS}
    overrides = (
        f"scene.path={quoted(str(Path(path).expanduser().absolute()))}",
        *(path_as_it_stands(f"{key}={value}") for key, value in given.items()),
        *(f"{key}={quoted(str(cache))}" for key, cache in caches.items() if key not in given),
    )
    config = absolute(load_config([*overrides, f"out={quoted(str(folder))}"]))
    return Job(name, given.get("experiment", ""), config, overrides)


def _name(row: Row) -> str:
    done = len(row.finished)
    if done == len(row.runs):
        return row.name
    if done:
        return f"{row.name} ({done} of {len(row.runs)} seeds)"
    return f"{row.name} ({'failed' if any(run.failed for run in row.runs) else 'not run yet'})"
