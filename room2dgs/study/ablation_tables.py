"""An ablation's tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from room2dgs.report.table import NOTHING, Table, table
from room2dgs.study.ablation import FAR_OFF, FINE, FINEST, FULL, NEAR_DEPTH, Row, Study, Value, difference

SIMULATED = "simulated priors"
# figure -> factor and decimals of what is shown
SHOWN: dict[str, tuple[float, int]] = {
    "accuracy_m": (100, 1),
    "completion_m": (100, 1),
    "precision": (1, 3),
    "recall": (1, 3),
    "f_score": (1, 3),
    FINE: (1, 3),
    FINEST: (1, 3),
    "normal_consistency": (1, 3),
    "tears_per_m": (1, 2),
    "coverage_known": (100, 1),
    "roughness_2cm_deg": (1, 1),
    "roughness_10cm_deg": (1, 1),
    "in_free_space": (100, 2),
    FAR_OFF: (100, 1),
    NEAR_DEPTH: (1, 3),
    "stereo_coverage": (100, 0),
    "chamfer_m": (100, 1),
    "psnr_db": (1, 1),
    "primitives": (1, 0),
    "train_s": (1 / 60, 1),
    "mesh_s": (1 / 60, 1),
    "train_and_mesh_s": (1 / 60, 1),
    "run_s": (1, 0),
    "cpu_s": (1, 0),
    "peak_memory_mb": (1e-3, 1),
}


def score_table(study: Study) -> Table:
    """Scores and costs of each row, as the paper's Table II has them and more."""
    columns: dict[str, Callable[[Row], str]] = {
        "row": _name,
        "acc. (cm)": _cell("accuracy_m"),
        "comp. (cm)": _cell("completion_m"),
        "precision": _cell("precision"),
        "recall": _cell("recall"),
        f"F @ {study.at}": _cell("f_score"),
        f"ΔF to {FULL}": lambda row: _minus_full(row, study.full),
        "F @ 2cm": _cell(FINE),
        "PSNR (dB)": _cell("psnr_db"),
        "surfels": _cell("primitives"),
        "train (min)": _cell("train_s"),
        "mesh (min)": _cell("mesh_s"),
        "memory (GB)": _cell("peak_memory_mb"),
        "priors": lambda row: row.priors or NOTHING,
    }
    return _table("Scores" + _seeds_note(study.rows), columns, study, study.rows)


def cost_table(study: Study) -> Table | None:
    """What each removed part costs and gives: full minus the row without it. None without a finished full row."""
    full = study.full
    others = [row for row in study.rows if row.finished and row is not full and not row.same_as]
    if full is None or not others:
        return None

    def gained(figure: str) -> Callable[[Row], str]:
        return lambda row: shown(difference(full, row, figure), figure, signed=True)

    columns: dict[str, Callable[[Row], str]] = {
        "without it": _name,
        "F gained": gained("f_score"),
        "F @ 2cm gained": gained(FINE),
        "train + mesh minutes added": gained("train_and_mesh_s"),
        "surfels added": gained("primitives"),
        "GB added": gained("peak_memory_mb"),
        "the part": lambda row: row.words or NOTHING,
    }
    return _table(
        f"What a part gives and costs: {FULL} minus the row without it, F @ {study.at}", columns, study, others
    )


def stage_table(study: Study) -> Table | None:
    """Seconds of training by stage, the mean over seeds. None if no run tells them."""
    timed = [row for row in study.rows if row.stages and not row.same_as]
    stages = list(dict.fromkeys(stage for row in timed for stage in row.stages))
    if not stages:
        return None
    columns: dict[str, Callable[[Row], str]] = {"row": _name}
    for stage in stages:
        columns[stage] = partial(_seconds, stage)
    columns["all"] = lambda row: f"{sum(row.stages.values()):.1f}"
    return _table("Seconds of training by stage", columns, study, timed)


def _seconds(stage: str, row: Row) -> str:
    return f"{row.stages[stage]:.1f}" if stage in row.stages else NOTHING


def shown(value: Value | None, figure: str, signed: bool = False) -> str:
    """`0.575 ± 0.004`, in the figure's unit; the mean alone without a spread."""
    if value is None:
        return NOTHING
    factor, decimals = SHOWN[figure]
    text = f"{value.mean * factor:{'+' if signed else ''},.{decimals}f}"
    return text if value.spread is None else f"{text} ± {value.spread * factor:,.{decimals}f}"


def _table(title: str, columns: dict[str, Callable[[Row], str]], study: Study, rows: Sequence[Row]) -> Table:
    return table(f"{title} ({SIMULATED})" if study.simulated else title, columns, rows)


def _name(row: Row) -> str:
    if row.same_as:
        return f"{row.name} (same settings as {row.same_as})"
    done = len(row.finished)
    if done == len(row.runs):
        return row.name
    if done:
        return f"{row.name} ({done} of {len(row.runs)} seeds)"
    return f"{row.name} ({'failed' if any(run.failed for run in row.runs) else 'not run yet'})"


def _cell(figure: str) -> Callable[[Row], str]:
    return lambda row: shown(row.values.get(figure), figure)


def _minus_full(row: Row, full: Row | None) -> str:
    return NOTHING if full is None or row is full else shown(difference(row, full, "f_score"), "f_score", signed=True)


def _seeds_note(rows: Sequence[Row]) -> str:
    seeds = sorted({run.seed for row in rows for run in row.runs})
    listed = ", ".join(map(str, seeds))
    return f": mean ± standard deviation over seeds {listed}" if len(seeds) > 1 else f", seed {listed}"
