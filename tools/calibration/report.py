"""Calibration as tables, JSON and a drawing."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from room2dgs.files import whole_file
from room2dgs.json_files import plain
from room2dgs.report.page import in_drawing
from room2dgs.report.table import NOTHING, Table, table
from room2dgs.tools.calibration.bins import Bin, Calibration

JSON, MARKDOWN, DRAWING = "calibration.json", "calibration.md", "calibration.png"
TITLES = {"depth": "Depth, errors as a share of the depth", "normal": "Normals"}
AXES = {"depth": "% of the depth", "normal": "degrees"}
LEAST_SHARE = 0.002  # of a source's pixels; bins with fewer are not drawn
NOTES = (
    "share: of the pixels whose truth is known, those that the source has (in bins: of the source's pixels); "
    "68 %: so many of the true errors are smaller; within: share of the pixels whose true error is at most the "
    "expected one, 68 % if that is a standard deviation and 50 % if it is a median",
    "network, aligned: to the sparse points and stereo's, view by view, with the error that the network itself "
    "expects; completed: the depth that training gets, and the error that its confidence stands for, where "
    "three photos agree, or what is worth as much (stereo), else where it lies on a plane of the room, else the rest",
    "sensor: the capture's depth against its mesh, the others against its depth; depth that was rendered of the mesh "
    "is no sensor's and left out; nothing is fitted to the truth",
)
Found = Mapping[str, Sequence[Calibration]]


def tables(found: Found) -> list[Table]:
    """All sources of all captures, then the bins of each source, depth before normals.

    Args:
        found: capture -> its sources.
    """
    shown = []
    for kind, title in TITLES.items():
        rows = [(scene, one) for scene, sources in found.items() for one in sources if one.kind == kind]
        if rows:
            shown.append(table(title, _columns(kind), rows))
    for kind, title in TITLES.items():
        parts = [
            (scene, one, part)
            for scene, sources in found.items()
            for one in sources
            if one.kind == kind
            for part in one.bins
        ]
        if parts:
            shown.append(table(f"{title}: bins of the expected error", _bin_columns(kind), parts))
    return shown


def write_calibration(out: Path, found: Found, about: dict[str, Any], text: str) -> None:
    """calibration.json, .md and .png.

    Args:
        about: command, machine, commit, where the truth comes from.
        text: of the Markdown file.
    """
    whole = {**about, "scenes": {scene: [asdict(one) for one in sources] for scene, sources in found.items()}}
    with whole_file(out / JSON) as temporary:
        temporary.write_text(json.dumps(plain(whole), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    with whole_file(out / MARKDOWN) as temporary:
        temporary.write_text(text, encoding="utf-8")
    with whole_file(out / DRAWING) as temporary:
        drawing(found).savefig(temporary, format="png", dpi=110)


def drawing(found: Found) -> Any:
    """A matplotlib figure: true over expected error, depth above normals, a column for each capture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(4.2 * len(found), 6), 8.4), layout="constrained")
    FigureCanvasAgg(figure)
    for row, kind in zip(figure.subplots(2, len(found), squeeze=False), TITLES, strict=True):
        for axes, (scene, sources) in zip(row, found.items(), strict=True):
            _draw(axes, kind, [one for one in sources if one.kind == kind and one.bins])
            axes.set_title(f"{in_drawing(scene)}, {kind}", fontsize=10)
    return figure


def _draw(axes: Any, kind: str, sources: Sequence[Calibration]) -> None:
    unit = 100 if kind == "depth" else 1
    ends = []
    for index, one in enumerate(sources):
        bins = [part for part in one.bins if part.share >= LEAST_SHARE and min(part.expected, part.p68) > 0]
        x = [unit * part.expected for part in bins]
        axes.plot(x, [unit * part.p68 for part in bins], "o-", color=f"C{index}", ms=4, label=one.source)
        axes.plot(x, [unit * part.median for part in bins], ":", color=f"C{index}")
        ends += [*x, *(unit * part.p68 for part in bins)]
    if ends:
        limits = (min(ends) / 1.5, max(ends) * 1.5)
        axes.plot(limits, limits, color="grey", lw=0.8)
        axes.set(xscale="log", yscale="log", xlim=limits, ylim=limits)
        axes.legend(frameon=False, fontsize=8)
    axes.set(xlabel=f"expected error, {AXES[kind]}", ylabel="true: 68 % (solid), median (dotted)")
    axes.grid(alpha=0.3)


Columns = dict[str, Callable[[Any], str]]


def _columns(kind: str) -> Columns:
    number = _number(kind)
    return {
        "capture": lambda row: row[0],
        "source": lambda row: row[1].source,
        "share": lambda row: f"{row[1].share:.1%}",
        "expected": lambda row: NOTHING if row[1].expected is None else number(row[1].expected),
        "true, median": lambda row: number(row[1].median),
        "true, 68 %": lambda row: number(row[1].p68),
        "within": lambda row: NOTHING if row[1].within is None else f"{row[1].within:.0%}",
    }


def _bin_columns(kind: str) -> Columns:
    number = _number(kind)
    return {
        "capture": lambda row: row[0],
        "source": lambda row: row[1].source,
        "expected": lambda row: _range(row[2], number),
        "share": lambda row: f"{row[2].share:.1%}",
        "expected, median": lambda row: number(row[2].expected),
        "true, median": lambda row: number(row[2].median),
        "true, 68 %": lambda row: number(row[2].p68),
    }


def _range(one: Bin, number: Callable[[float], str]) -> str:
    return f"over {number(one.low)}" if one.high == float("inf") else f"{number(one.low)} to {number(one.high)}"


def _number(kind: str) -> Callable[[float], str]:
    return (lambda value: f"{100 * value:.2f} %") if kind == "depth" else (lambda value: f"{value:.1f}°")
