"""The curve of scores over a prior's errors, drawn, and as one HTML file that needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from room2dgs.files import whole_file
from room2dgs.report.page import drawn
from room2dgs.report.page import page as filled
from room2dgs.study.ablation import FINE
from room2dgs.study.ablation_tables import SIMULATED
from room2dgs.tools.prior_error.curve import F_SCORE, Curve, known, label, sentences, table

HTML, DRAWING = "prior_error.html", "prior_error.svg"
AXES = {"normal_deg": "normals, mean error in degrees", "abs_rel": "depth, AbsRel after scale and shift"}
COLORS = {F_SCORE: "#1f5fa8", FINE: "#c05a1c"}


def write_page(curve: Curve, out: Path) -> None:
    """prior_error.svg, and prior_error.html with the curve, the table and what they say."""
    figure = drawing(curve)
    with whole_file(out / DRAWING) as temporary:
        figure.savefig(temporary, format="svg")
    with whole_file(out / HTML) as temporary:
        temporary.write_text(page(curve, figure), encoding="utf-8")


def drawing(curve: Curve) -> Any:
    """A matplotlib figure: scores over the error of normals and over that of depth."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{curve.title} ({SIMULATED} but where a network is named)", fontsize=11)
    for axes, error in zip(figure.subplots(1, 2, sharey=True), AXES, strict=True):
        for score, name in ((F_SCORE, f"F @ {curve.at}"), (FINE, "F @ 2cm")):
            _draw(axes, curve, error, score, name)
        axes.set(xlabel=AXES[error], ylim=(0, 1))
        axes.set_xlim(left=0)
        axes.grid(alpha=0.3)
    first = figure.axes[0]
    first.set_ylabel("F-score")
    if first.get_legend_handles_labels()[0]:
        first.legend(frameon=False, fontsize=8)
    return figure


def page(curve: Curve, figure: Any) -> str:
    """The whole page around a drawing."""
    return filled(
        "curve.html.j2",
        title=curve.title,
        command=curve.command,
        label=label().replace("**", ""),
        drawing=drawn(figure, dpi=150),
        table=table(curve),
        sentences=sentences(curve),
    )


def _draw(axes: Any, curve: Curve, error: str, score: str, name: str) -> None:
    color = COLORS[score]
    simulated = known(curve.of("simulated"), error, score)
    if simulated:
        x, y = curve.line(error, score).T
        axes.plot(x, y, "o-", color=color, ms=4, label=f"{name}, simulated")
        for point, at, height in simulated:
            spread = point.row.values[score].spread
            if spread is not None:
                axes.errorbar(at, height, spread, color=color, capsize=3)
    for _, at, height in known(curve.of("noise"), error, score):
        axes.plot(at, height, "x", color=color, label=f"{name}, noise (simulated)")
    for point in curve.of("none"):
        level = point.score(score)
        if level is not None:
            axes.axhline(level, color=color, ls=":", lw=1, label=f"{name}, no prior")
    for point, at, height in known(curve.of("real"), error, score):
        axes.plot(at, height, "*", color=color, ms=12, mec="black", mew=0.5)
        if score == F_SCORE:
            axes.annotate(point.row.name, (at, height), (6, 6), textcoords="offset points", fontsize=8)
