"""Scores of several methods on several scenes, in the columns of the paper's Table I."""

from __future__ import annotations

import html
import math
import re
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from room2dgs.report.csv_text import as_csv_text
from room2dgs.report.table import NOTHING, Table, in_markdown, markdown
from room2dgs.texts import shown

# heading -> figure, and whether more of it is better
COLUMNS = {
    "Acc.": ("accuracy_m", False),
    "Comp.": ("completion_m", False),
    "Prec.": ("precision", True),
    "Recall": ("recall", True),
    "F-score": ("f_score", True),
}
FIGURES = tuple(figure for figure, _ in COLUMNS.values())
SCANNET, SCANNETPP, OTHER = "ScanNet", "ScanNet++", "other scenes"


LATEX = {
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
    "\\": "\\textbackslash{}",
    "~": "\\textasciitilde{}",
    "^": "\\textasciicircum{}",
}


@dataclass(frozen=True)
class Score:
    """One mesh against the truth of one scene.

    Attributes:
        values: figure -> number; empty if there are none.
        failed: why there are none, in a sentence.
    """

    method: str
    scene: str
    values: Mapping[str, float]
    failed: str = ""


def dataset_of(scene: str) -> str:
    """By how its scenes are called."""
    if re.fullmatch(r"scene\d{4}_\d{2}.*", scene):
        return SCANNET
    return SCANNETPP if re.fullmatch(r"[0-9a-f]{10}", scene) else OTHER


def values_of(metrics: Mapping[str, Any], protocol: str, at: str) -> dict[str, float] | None:
    """The figures that metrics.json has under a protocol; None if it was not scored so.

    Args:
        at: name of the threshold, "5cm".
    """
    found = (metrics.get("protocols") or {}).get(protocol)
    if not found:
        return None
    names = {"accuracy_m": "accuracy_m", "completion_m": "completion_m"}
    names |= {figure: f"{figure}_{at}" for figure in ("precision", "recall", "f_score")}
    values = {figure: found.get(name) for figure, name in names.items()}
    return (
        None
        if any(value is None for value in values.values())
        else {k: float(v) for k, v in values.items() if v is not None}
    )


def means(scores: Sequence[Score]) -> pd.DataFrame:
    """Method by (dataset, heading): mean over the scenes of the dataset that the method has; NaN without any.

    Several runs of a scene count as one: their mean.
    """
    methods = list(dict.fromkeys(score.method for score in scores))
    datasets = [one for one in (SCANNET, SCANNETPP, OTHER) if any(dataset_of(score.scene) == one for score in scores)]
    columns = pd.MultiIndex.from_product([datasets, COLUMNS])
    frame = pd.DataFrame(index=methods, columns=columns, dtype=float)
    for method in methods:
        for dataset in datasets:
            mine = [score for score in scores if score.method == method and dataset_of(score.scene) == dataset]
            for heading, (figure, _) in COLUMNS.items():
                by_scene: dict[str, list[float]] = {}
                for score in mine:
                    if score.values:
                        by_scene.setdefault(score.scene, []).append(score.values[figure])
                if by_scene:
                    frame.loc[method, (dataset, heading)] = statistics.fmean(map(statistics.fmean, by_scene.values()))
    return frame


def notes(scores: Sequence[Score]) -> list[str]:
    """What failed, and means that lack scenes which others have."""
    lines = [f"{score.method}, {score.scene}: {score.failed}" for score in scores if score.failed]
    for dataset in dict.fromkeys(dataset_of(score.scene) for score in scores):
        scenes = {score.scene for score in scores if dataset_of(score.scene) == dataset}
        for method in dict.fromkeys(score.method for score in scores):
            has = {score.scene for score in scores if score.method == method and score.values} & scenes
            if has and has != scenes:
                without = ", ".join(sorted(scenes - has))
                lines.append(f"{method}: mean of {len(has)} of {len(scenes)} scenes of {dataset}, without {without}")
    return lines


def as_csv(scores: Sequence[Score]) -> str:
    """A line for each mesh."""
    rows = [
        {"dataset": dataset_of(one.scene), "scene": one.scene, "method": one.method, **one.values, "failed": one.failed}
        for one in scores
    ]
    return as_csv_text(pd.DataFrame(rows, columns=["dataset", "scene", "method", *FIGURES, "failed"]))


def as_markdown(scores: Sequence[Score], title: str) -> str:
    """Means, then every scene, then notes."""
    frame = means(scores)
    best = _best(frame)
    cells = [
        [
            method,
            *(_cell(frame.iloc[row, column], best.iloc[row, column], "**{}**") for column in range(frame.shape[1])),
        ]
        for row, method in enumerate(frame.index)
    ]
    headings = ["Method", *(f"{dataset} {_arrowed(heading)}" for dataset, heading in frame.columns)]
    tables = [markdown(Table(title, pd.DataFrame(cells, columns=headings, dtype=str)))]
    each = [
        [one.scene, one.method, *(_cell(one.values.get(figure), False, "{}") for figure, _ in COLUMNS.values())]
        for one in sorted(scores, key=lambda one: one.scene)
    ]
    tables.append(markdown(Table("", pd.DataFrame(each, columns=["scene", "Method", *COLUMNS], dtype=str))))
    return "\n\n".join([*tables, *(f"- {in_markdown(line)}" for line in notes(scores))]) + "\n"


def as_html(scores: Sequence[Score], title: str) -> str:
    """The means as a page of its own."""
    frame = means(scores)
    best = _best(frame)
    datasets = list(dict.fromkeys(dataset for dataset, _ in frame.columns))
    top = "".join(f'<th colspan="{len(COLUMNS)}">{html.escape(one)}</th>' for one in datasets)
    second = "".join(f"<th>{_arrowed(heading)}</th>" for _, heading in frame.columns)
    rows = "".join(
        f"<tr><td>{html.escape(shown(method))}</td>"
        + "".join(
            f"<td>{_cell(frame.iloc[row, c], best.iloc[row, c], '<b>{}</b>')}</td>" for c in range(frame.shape[1])
        )
        + "</tr>\n"
        for row, method in enumerate(frame.index)
    )
    said = "".join(f"<p>{html.escape(shown(line))}</p>\n" for line in notes(scores))
    said_title = html.escape(shown(title))
    style = "body{font-family:sans-serif}td,th{padding:2px 8px;text-align:right}td:first-child{text-align:left}"
    return (
        f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{said_title}</title><style>{style}</style>\n'
        f"<h1>{said_title}</h1>\n<table>\n<tr><th></th>{top}</tr>\n<tr><th>Method</th>{second}</tr>\n"
        f"{rows}</table>\n{said}</html>\n"
    )


def as_latex(scores: Sequence[Score], title: str) -> str:
    """The means as a table of booktabs."""
    frame = means(scores)
    best = _best(frame)
    datasets = list(dict.fromkeys(dataset for dataset, _ in frame.columns))
    top = " & ".join(f"\\multicolumn{{{len(COLUMNS)}}}{{c}}{{{_escaped(one)}}}" for one in datasets)
    arrows = {True: "$\\uparrow$", False: "$\\downarrow$"}
    second = " & ".join(f"{heading} {arrows[COLUMNS[heading][1]]}" for _, heading in frame.columns)
    rows = [
        " & ".join(
            [
                _escaped(str(method)),
                *(_cell(frame.iloc[row, c], best.iloc[row, c], "\\textbf{{{}}}") for c in range(frame.shape[1])),
            ]
        )
        + " \\\\"
        for row, method in enumerate(frame.index)
    ]
    return "\n".join(
        [
            *(f"% {shown(line)}" for line in notes(scores)),
            "\\begin{table}",
            f"\\caption{{{_escaped(title)}}}",
            f"\\begin{{tabular}}{{l{'c' * frame.shape[1]}}}",
            "\\toprule",
            f" & {top} \\\\",
            f"Method & {second} \\\\",
            "\\midrule",
            *rows,
            "\\bottomrule",
            "\\end{tabular}",
            "\\end{table}",
            "",
        ]
    )


def _best(frame: pd.DataFrame) -> pd.DataFrame:
    """Where the best value of each column stands, to the digits that are shown."""
    shown = frame.round(3)
    found = pd.DataFrame(False, index=frame.index, columns=frame.columns)
    for column in frame.columns:
        values = shown[column]
        found[column] = values == (values.max() if COLUMNS[column[1]][1] else values.min())
    return found


def _cell(value: float | None, best: bool, bold: str) -> str:
    if value is None or math.isnan(value):
        return NOTHING
    return bold.format(f"{value:.3f}") if best else f"{value:.3f}"


def _arrowed(heading: str) -> str:
    return f"{heading} {'↑' if COLUMNS[heading][1] else '↓'}"


def _escaped(text: str) -> str:
    return "".join(LATEX.get(letter, letter) for letter in shown(text))
