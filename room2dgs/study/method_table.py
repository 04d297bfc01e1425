"""The paper's Table I on one's own captures: rows of `ablate`, pictures against surfaces, published figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.files import whole_file
from room2dgs.json_files import read_json
from room2dgs.report.csv_text import csv_lines
from room2dgs.report.page import drawn, in_drawing, page
from room2dgs.report.table import NOTHING, table
from room2dgs.runs.metrics import machine, read_metrics
from room2dgs.study.ablation import FINE, figures_of

CSV, HTML = "bench_table.csv", "bench_table.html"
METHODS = ("plain_3dgs", "rade_3dgs", "plain_2dgs", "pgsr_2dgs")
OURS = ("no_seed", "no_depth", "no_normal", "no_mv", "full")
PUBLISHED = {  # F-score at 5 cm on ScanNet and on ScanNet++, as the 2DGS-Room paper prints them (its Table I)
    "NeuS": (0.409, 0.251), "Neuralangelo": (0.255, 0.141), "3DGS": (0.085, 0.104), "SuGaR": (0.366, 0.361),
    "2DGS": (0.341, 0.183), "PGSR": (0.426, 0.249), "RaDe-GS": (0.306, 0.166), "2DGS-Room": (0.575, 0.464),
}  # fmt: skip
GROUPS = {  # of rows: what they are, and their colour
    "3D Gaussians, photos alone": "#c2185b",
    "surfels, photos alone": "#1565c0",
    "surfels with priors": "#2e7d32",
}
NEAR = (0.5, 0.01)  # dB and F: rows whose labels would cover each other
LABEL_PT = 11  # from a label to the one below it
FIGURES = ("f_score", FINE, "psnr_db", "run_s", "primitives")
NOTES = (
    "rows: our own code under the settings of that name, each in runs of its own; means over the seeds",
    "published: printed in the 2DGS-Room paper for 8 scenes of ScanNet and 4 of ScanNet++, on a GPU with 30,000 "
    "iterations, at 5 cm by another protocol; their order says something, their numbers are none of these captures'",
    "minutes: all that makes the mesh, with poses, points and priors; PSNR: held-out views",
)


@dataclass(frozen=True)
class Line:
    """A row of one capture; a figure that is not known is absent.

    Attributes:
        values: of `FIGURES`.
    """

    capture: str
    method: str
    values: Mapping[str, float]


def lines_of_study(capture: str, path: Path) -> list[Line]:
    """What `ablate` has written to ablation.json."""
    rows = (read_json(path) or {}).get("rows", [])
    return [
        Line(capture, row["name"], {name: value["mean"] for name, value in row["values"].items() if name in FIGURES})
        for row in rows
    ]


def line_of_mesh(capture: str, name: str, scores: Path, at: str) -> Line:
    """What `eval` has written for a mesh of another program."""
    found = figures_of(read_metrics(scores), at)
    return Line(capture, name, {key: found[key] for key in ("f_score", FINE) if key in found})


def write_report(out: Path, lines: Sequence[Line], command: str, at: str) -> str:
    """bench_table.csv and bench_table.html; returns the table as text for a terminal."""
    from room2dgs.report.table import terminal

    names = ("capture", "method", *FIGURES)
    rows = [[line.capture, line.method, *(line.values.get(name, "") for name in FIGURES)] for line in lines]
    columns = {
        "capture": lambda line: line.capture,
        "method": lambda line: line.method,
        f"F @ {at}": _cell("f_score", "{:.3f}"),
        "F @ 2cm": _cell(FINE, "{:.3f}"),
        "PSNR, dB": _cell("psnr_db", "{:.1f}"),
        "minutes": _cell("run_s", "{:.1f}", 1 / 60),
        "primitives": _cell("primitives", "{:,.0f}"),
    }
    shown = table("Pictures and surfaces", columns, list(lines))
    text = page(
        "curve.html.j2",
        title="Pictures and surfaces",
        command=command,
        label=_machine(),
        drawing=picture(lines, at),
        table=shown,
        sentences=[*NOTES, *_published()],
    )
    for name, content in ((CSV, csv_lines([names, *rows])), (HTML, text)):
        with whole_file(out / name) as temporary:
            temporary.write_text(content, encoding="utf-8")
    return terminal(shown)


def picture(lines: Sequence[Line], at: str) -> np.ndarray:
    """Pictures to the right, surfaces upwards: a drawing for each capture, and the published F-scores as bars."""
    from matplotlib.figure import Figure as Drawing

    captures = list(dict.fromkeys(line.capture for line in lines))
    figure = Drawing(figsize=(5.5 * (len(captures) + 1), 4.6), layout="constrained")
    *plots, bars = figure.subplots(1, len(captures) + 1, squeeze=False)[0]
    for plot, capture in zip(plots, captures, strict=True):
        labelled: list[tuple[float, float]] = []
        for line in (line for line in lines if line.capture == capture):
            f_score, psnr = line.values.get("f_score"), line.values.get("psnr_db")
            if f_score is not None and psnr is not None:
                group = _group(line.method)
                new = group not in plot.get_legend_handles_labels()[1]
                mark = "s" if line.method in METHODS else "o"
                plot.plot(psnr, f_score, mark, color=GROUPS[group], label=group if new else None)
                place = (5, 4 - LABEL_PT * sum(_near(psnr, f_score, other) for other in labelled))
                plot.annotate(in_drawing(line.method), (psnr, f_score), textcoords="offset points", xytext=place)
                labelled.append((psnr, f_score))
            elif f_score is not None:
                plot.axhline(f_score, color="grey", lw=0.8, ls=":")
                plot.annotate(in_drawing(line.method), (0.01, f_score), xycoords=("axes fraction", "data"))
        plot.set(xlabel="held-out PSNR, dB (pictures)", ylabel=f"F @ {at} (surface)", title=in_drawing(capture))
        plot.margins(0.2)
        if labelled:
            plot.legend(loc="best", fontsize="small")
    names = list(PUBLISHED)
    bars.barh(names, [PUBLISHED[name][0] for name in names], color="#bbbbbb")
    bars.invert_yaxis()
    bars.set(title="published, on ScanNet", xlabel="F @ 5cm")
    return drawn(figure, dpi=110)


def _near(psnr: float, f_score: float, other: tuple[float, float]) -> bool:
    """Would a label here lie on that of another row?"""
    return abs(psnr - other[0]) < NEAR[0] and abs(f_score - other[1]) < NEAR[1]


def _published() -> list[str]:
    return [f"{name}, published: F {a:.3f} on ScanNet, {b:.3f} on ScanNet++" for name, (a, b) in PUBLISHED.items()]


def _group(method: str) -> str:
    gaussians, photos, priors = GROUPS
    return gaussians if "3dgs" in method else (photos if "2dgs" in method else priors)


def _cell(name: str, form: str, factor: float = 1.0) -> Any:
    def cell(line: Line) -> str:
        value = line.values.get(name)
        return NOTHING if value is None else form.format(factor * value)

    return cell


def _machine() -> str:
    about = machine()
    return f"{about['processor']}, {about['cores']} cores"
