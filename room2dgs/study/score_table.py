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
MARK = "†"
SAME_DEPTH = "the truth was made from the depth that the run used: compare with no score of photos alone"
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
        same_depth: the truth was made from the depth that the run used (`truth_from_same_depth`).
    """

    method: str
    scene: str
    values: Mapping[str, float]
    failed: str = ""
    same_depth: bool = False


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
    if any(score.same_depth for score in scores):
        lines.append(f"{MARK} {SAME_DEPTH}")
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
        {
            **{"dataset": dataset_of(one.scene), "scene": one.scene, "method": one.method},
            **{**one.values, "truth_from_same_depth": one.same_depth, "failed": one.failed},
        }
        for one in scores
    ]
    columns = ["dataset", "scene", "method", *FIGURES, "truth_from_same_depth", "failed"]
    return as_csv_text(pd.DataFrame(rows, columns=columns))


def as_markdown(scores: Sequence[Score], title: str) -> str:
    """Means, then every scene, then notes."""
    frame = means(scores)
    shown_cells = _cells(scores, frame, "**{}**")
    cells = [[method, *row] for method, row in zip(frame.index, shown_cells, strict=True)]
    headings = ["Method", *(f"{dataset} {_arrowed(heading)}" for dataset, heading in frame.columns)]
    tables = [markdown(Table(title, pd.DataFrame(cells, columns=headings, dtype=str)))]
    each = [
        [
            one.scene,
            one.method,
            *(_cell(one.values.get(figure), False, "{}", one.same_depth) for figure, _ in COLUMNS.values()),
        ]
        for one in sorted(scores, key=lambda one: one.scene)
    ]
    tables.append(markdown(Table("", pd.DataFrame(each, columns=["scene", "Method", *COLUMNS], dtype=str))))
    return "\n\n".join([*tables, *(f"- {in_markdown(line)}" for line in notes(scores))]) + "\n"


def as_html(scores: Sequence[Score], title: str) -> str:
    """The means as a page of its own."""
    frame = means(scores)
    datasets = list(dict.fromkeys(dataset for dataset, _ in frame.columns))
    top = "".join(f'<th colspan="{len(COLUMNS)}">{html.escape(one)}</th>' for one in datasets)
    second = "".join(f"<th>{_arrowed(heading)}</th>" for _, heading in frame.columns)
    rows = "".join(
        f"<tr><td>{html.escape(shown(method))}</td>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>\n"
        for method, cells in zip(frame.index, _cells(scores, frame, "<b>{}</b>"), strict=True)
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
    datasets = list(dict.fromkeys(dataset for dataset, _ in frame.columns))
    top = " & ".join(f"\\multicolumn{{{len(COLUMNS)}}}{{c}}{{{_escaped(one)}}}" for one in datasets)
    arrows = {True: "$\\uparrow$", False: "$\\downarrow$"}
    second = " & ".join(f"{heading} {arrows[COLUMNS[heading][1]]}" for _, heading in frame.columns)
    rows = [
        " & ".join([_escaped(str(method)), *cells]).replace(MARK, "$^\\dagger$") + " \\\\"
        for method, cells in zip(frame.index, _cells(scores, frame, "\\textbf{{{}}}"), strict=True)
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


def _cells(scores: Sequence[Score], frame: pd.DataFrame, bold: str) -> list[list[str]]:
    """Rows of `means` as text: the best of each column, to the digits that are shown, is bold if there are several
    methods; what was scored against a truth of the same depth is marked and never the best.
    """
    marked = frame.copy().astype(object)
    for method in frame.index:
        for dataset, heading in frame.columns:
            marked.loc[method, (dataset, heading)] = any(
                one.same_depth for one in scores if one.method == method and dataset_of(one.scene) == dataset
            )
    rounded = frame.round(3).where(~marked.astype(bool))
    rows = []
    for row in range(len(frame)):
        cells = []
        for column, (_, heading) in enumerate(frame.columns):
            values = rounded.iloc[:, column]
            best = values.max() if COLUMNS[heading][1] else values.min()
            is_best = len(frame) > 1 and values.iloc[row] == best
            cells.append(_cell(frame.iloc[row, column], is_best, bold, marked.iloc[row, column]))
        rows.append(cells)
    return rows


def _cell(value: float | None, best: bool, bold: str, same_depth: bool = False) -> str:
    if value is None or math.isnan(value):
        return NOTHING
    mark = MARK if same_depth else ""
    return (bold.format(f"{value:.3f}") if best else f"{value:.3f}") + mark


def _arrowed(heading: str) -> str:
    return f"{heading} {'↑' if COLUMNS[heading][1] else '↓'}"


def _escaped(text: str) -> str:
    return "".join(LATEX.get(letter, letter) for letter in shown(text))
