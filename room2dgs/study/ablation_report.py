"""An ablation's files: ablation.md, ablation.json, ablation.html, and with a ground truth ablation.png."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from room2dgs.captures.scene import Scene
from room2dgs.files import whole_file
from room2dgs.report.table import Table, markdown
from room2dgs.study.ablation import Study, figures_of
from room2dgs.study.ablation_order import order_sentences, pairs_of, ratio_sentences
from room2dgs.study.ablation_page import page
from room2dgs.study.ablation_pictures import MeshView, mesh_views, write_error_sheet
from room2dgs.study.ablation_tables import SIMULATED, cost_table, score_table, stage_table

MARKDOWN, JSON, HTML, SHEET = "ablation.md", "ablation.json", "ablation.html", "ablation.png"
MESH = "mesh.ply"


def write_tables(study: Study, out: Path) -> str:
    """ablation.md and ablation.json from what is finished so far; returns the Markdown."""
    label = f"**{SIMULATED}**: maps were made from the ground truth; this shows the method alone"
    parts = [f"# {study.title}", f"`{study.command}`", *([label] if study.simulated else [])]
    parts += [markdown(table) for table in tables(study)]
    parts += ["\n".join(f"- {line}" for line in sentences(study))]
    parts += ["\n".join(f"- **{row.name}**: {row.words}" for row in study.rows if row.words)]
    text = "\n\n".join(parts) + "\n"
    with whole_file(out / MARKDOWN) as temporary:
        temporary.write_text(text, encoding="utf-8")
    with whole_file(out / JSON) as temporary:
        temporary.write_text(json.dumps(as_json(study), indent=2) + "\n", encoding="utf-8")
    return text


def write_page(study: Study, out: Path, scene: Scene, gt: Path | None) -> None:
    """ablation.html, and ablation.png with the errors of all rows; no pictures without a ground truth.

    Raises:
        InputError: a mesh cannot be read.
    """
    meshes = {row.name: row.finished[0].folder / MESH for row in study.rows if row.finished and not row.same_as}
    views: list[MeshView] = mesh_views(meshes, gt, scene, study.threshold_m) if gt and meshes else []
    if views:
        write_error_sheet(out / SHEET, views, study)
    with whole_file(out / HTML) as temporary:
        temporary.write_text(page(study, tables(study), sentences(study), views), encoding="utf-8")


def tables(study: Study) -> list[Table]:
    """Scores, what parts give and cost, seconds by stage: those that there is something to say in."""
    return [table for table in (score_table(study), cost_table(study), stage_table(study)) if table]


def sentences(study: Study) -> list[str]:
    """The ordering, the ratios, what failed, and what must be known to read the table."""
    lines = order_sentences(study) + ratio_sentences(study)
    runs = [run for row in study.rows for run in row.runs]
    lines += [f"{run.row}, seed {run.seed}, failed: {run.failed}" for run in runs if run.failed]
    for stage, what in (("points_s", "sparse points"), ("priors_s", "priors")):
        longest = max((figures_of(run.metrics, study.at).get(stage, 0.0) for run in runs), default=0.0)
        if longest >= 1:
            lines.append(f"{what}: {longest / 60:.1f} min in the run that took longest, in no row's minutes")
    commits = sorted({str(run.metrics.get("commit")) for run in runs if run.metrics})
    if len(commits) > 1:
        lines.append(f"the runs were made by {len(commits)} commits: {', '.join(commits)}")
    return lines


def as_json(study: Study) -> dict[str, Any]:
    """Everything that the tables say, as plain values."""
    return {
        "title": study.title,
        "command": study.command,
        "threshold_m": study.threshold_m,
        "simulated_priors": study.simulated,
        "rows": [
            {
                "name": row.name,
                "words": row.words,
                "same_as": row.same_as or None,
                "priors": row.priors or None,
                "values": {name: asdict(value) for name, value in row.values.items()},
                "training_seconds": row.stages,
                "runs": [
                    {
                        "seed": run.seed,
                        "folder": str(run.folder),
                        "failed": run.failed or None,
                        "values": figures_of(run.metrics, study.at),
                    }
                    for run in row.runs
                ],
            }
            for row in study.rows
        ],
        "table_ii": [{**asdict(pair), "holds": pair.holds, "clear": pair.clear} for pair in pairs_of(study.rows)],
    }
