"""An ablation as one HTML file: tables, what was removed, pictures of the meshes."""

from __future__ import annotations

from collections.abc import Sequence

from room2dgs.eval.pictures import COLUMNS, FULL_THRESHOLDS
from room2dgs.eval.shading import RAMP
from room2dgs.report.page import Figure
from room2dgs.report.page import page as filled
from room2dgs.report.table import Table
from room2dgs.study.ablation import Row, Study
from room2dgs.study.ablation_pictures import MeshView
from room2dgs.study.ablation_tables import SIMULATED


def page(study: Study, tables: Sequence[Table], sentences: Sequence[str], views: Sequence[MeshView]) -> str:
    """The whole page.

    Args:
        sentences: what to say between tables and pictures.
        views: the pictures; none when there is no ground truth.
    """
    return filled(
        "ablation.html.j2",
        title=study.title,
        study=study,
        simulated=SIMULATED,
        tables=tables,
        sentences=sentences,
        sections=[(kind, [_figures(study, view, place) for view in views]) for place, kind in enumerate(COLUMNS)]
        if views
        else [],
        stops=[f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in RAMP * 255],
        end_cm=FULL_THRESHOLDS * study.threshold_m * 100,
    )


def _figures(study: Study, view: MeshView, place: int) -> tuple[str, list[Figure]]:
    """One camera's title, and its pictures of one kind: the photo, then a mesh for each row."""
    by_name = {row.name: row for row in study.rows}
    figures = [] if view.photo is None else [Figure("photo", view.photo)]
    figures += [Figure(_caption(by_name[name], study.at), tiles[place]) for name, tiles in view.tiles.items()]
    return view.title, figures


def _caption(row: Row, at: str) -> str:
    run = row.finished[0]
    score = (run.metrics or {}).get(f"f_score_{at}")
    return f"{row.name}, seed {run.seed}, priors: {row.priors}" + ("" if score is None else f", F @ {at} {score:.3f}")
