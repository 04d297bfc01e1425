"""Score against time, drawn, and as one HTML file that needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from room2dgs.files import whole_file
from room2dgs.report.page import drawn, in_drawing
from room2dgs.report.page import page as filled
from room2dgs.study.ablation import FINE
from room2dgs.tools.tradeoff.points import Tradeoff, score_table, sentences

HTML, DRAWING = "tradeoff.html", "tradeoff.png"
TITLE = "Score against time"
MARKS = "osD^vP*Xhd"


def write_page(found: Tradeoff, out: Path) -> None:
    """tradeoff.png, and tradeoff.html with the drawing, the table and what must be known."""
    figure = drawing(found)
    with whole_file(out / DRAWING) as temporary:
        figure.savefig(temporary, format="png", dpi=110)
    text = filled(
        "curve.html.j2",
        title=TITLE,
        command=found.command,
        label="",
        drawing=drawn(figure, dpi=150),
        table=score_table(found),
        sentences=sentences(found),
    )
    with whole_file(out / HTML) as temporary:
        temporary.write_text(text, encoding="utf-8")


def drawing(found: Tradeoff) -> Any:
    """A matplotlib figure: F-scores over CPU seconds, a colour for each capture, a mark for each point."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter

    figure = Figure(figsize=(11, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    captures = list(dict.fromkeys(row.name.removesuffix(f", {row.words}") for row in found.rows))
    names = {"f_score": f"F @ {found.at}", FINE: "F @ 2cm"}
    for axes, (score, name) in zip(figure.subplots(1, 2), names.items(), strict=True):
        for index, point in enumerate(found.points):
            for row in found.line(point):
                if score not in row.values or "cpu_s" not in row.values:
                    continue
                color = f"C{captures.index(row.name.removesuffix(f', {point}')) % 10}"
                at = row.values["cpu_s"].mean, row.values[score].mean
                axes.plot(*at, MARKS[index % len(MARKS)], color=color)
                axes.annotate(point, at, (5, 3), textcoords="offset points", fontsize=7)
        axes.set(xlabel="CPU seconds", ylabel=name, xscale="log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.margins(x=0.15)  # room for the names
        axes.grid(alpha=0.3)
    for index, capture in enumerate(captures):
        figure.axes[0].plot([], [], "o", color=f"C{index % 10}", label=in_drawing(capture))
    figure.legend(frameon=False, fontsize=8, loc="outside upper center", ncols=6)  # over no mark
    return figure
