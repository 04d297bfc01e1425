"""Splats against seconds as a table, CSV, JSON and one HTML page with the curves."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.bench.splats import METHODS, Point
from room2dgs.files import whole_file
from room2dgs.json_files import plain
from room2dgs.report.csv_text import csv_lines
from room2dgs.report.page import drawn, in_drawing, page
from room2dgs.report.table import NOTHING, Table, table

CSV, JSON, HTML = "bench_splats.csv", "bench_splats.json", "bench_splats.html"
NOTES = (
    "seconds: of training, without reading, poses, points and priors, which are beside them, and without evaluations; "
    "another program's are what its files' names say",
    "PSNR and SSIM: means over the held-out views at the size of the run, within masks, by one code for all",
    "memory: the largest resident memory of the method's own process so far, evaluations included",
)


def points_table(points: Sequence[Point]) -> Table:
    """A row for each point."""
    return table("Held-out views against seconds of training", _COLUMNS, list(points))


def write_report(out: Path, points: Sequence[Point], about: dict[str, Any]) -> None:
    """bench_splats.csv, .json and .html in a folder; what is there is replaced.

    Args:
        about: "command", "machine", "commit", ...
    """
    out.mkdir(parents=True, exist_ok=True)
    names = list(Point.__dataclass_fields__)
    rows = [[point.as_dict()[name] for name in names] for point in points]
    texts = {
        CSV: csv_lines([names, *[["" if value is None else value for value in row] for row in rows]]),
        JSON: json.dumps(plain({**about, "points": [point.as_dict() for point in points]}), indent=1) + "\n",
        HTML: _page(points, about),
    }
    for name, text in texts.items():
        with whole_file(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _page(points: Sequence[Point], about: dict[str, Any]) -> str:
    machine = about["machine"]
    methods = dict.fromkeys(point.method for point in points)
    return page(
        "curve.html.j2",
        title="Splats against seconds",
        command=about["command"],
        label=f"{machine['processor']}, {machine['cores']} cores; commit {about['commit']}",
        drawing=curves(points),
        table=points_table(points),
        sentences=[*NOTES, *(f"{name}: {METHODS[name][1]}" for name in methods if name in METHODS)],
    )


def curves(points: Sequence[Point]) -> np.ndarray:
    """A row of drawings for each capture: PSNR against wall seconds and processor seconds, and primitives."""
    from matplotlib.figure import Figure as Drawing

    captures = list(dict.fromkeys(point.capture for point in points))
    figure = Drawing(figsize=(15, 4.2 * max(1, len(captures))), layout="constrained")
    axes = figure.subplots(max(1, len(captures)), 3, squeeze=False)
    for row, capture in zip(axes, captures, strict=False):
        for plot, (x, label, log) in zip(row, _AXES, strict=True):
            for method in dict.fromkeys(point.method for point in points if point.capture == capture):
                of_it = [point for point in points if (point.capture, point.method) == (capture, method)]
                places = [(getattr(point, x), point.psnr_db) for point in of_it if getattr(point, x) is not None]
                if places:
                    plot.plot(*zip(*places, strict=True), "o-", ms=4, label=in_drawing(method))
            plot.set(xlabel=label, ylabel="held-out PSNR, dB", title=in_drawing(capture))
            if log and plot.lines:
                plot.set_xscale("log")
            if plot.lines:
                plot.legend(frameon=False)
            else:  # another program's processor seconds are not known
                plot.set_axis_off()
    return drawn(figure, dpi=110)


_AXES = (
    ("seconds", "seconds of training", True),
    ("cpu_seconds", "processor seconds of training", True),
    ("primitives", "primitives", True),
)


def _cell(name: str, form: str) -> Callable[[Point], str]:
    def cell(point: Point) -> str:
        value = getattr(point, name)
        return NOTHING if value is None else form.format(value)

    return cell


_COLUMNS: dict[str, Callable[[Point], str]] = {
    "capture": lambda point: point.capture,
    "method": lambda point: point.method,
    "seconds": _cell("seconds", "{:.0f}"),
    "processor s": _cell("cpu_seconds", "{:.0f}"),
    "before, s": _cell("preparation_seconds", "{:.0f}"),
    "iteration": _cell("iteration", "{:,}"),
    "primitives": _cell("primitives", "{:,}"),
    "PSNR, dB": _cell("psnr_db", "{:.2f}"),
    "SSIM": _cell("ssim", "{:.3f}"),
    "memory, MB": _cell("peak_memory_mb", "{:,.0f}"),
}
