"""Score a mesh file against a ground-truth file: numbers, pictures, and where the error sits."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from room2dgs.captures.scene import Scene
from room2dgs.config import EvalConfig
from room2dgs.errors import InputError
from room2dgs.eval import pictures
from room2dgs.eval.error_sites import sentences, where_the_error_sits
from room2dgs.eval.geometry_scores import threshold_name
from room2dgs.eval.protocol import MeshFile, Result, load
from room2dgs.eval.protocol_area import AreaResult, area
from room2dgs.eval.protocol_manhattan import manhattan
from room2dgs.eval.protocol_neuris import neuris
from room2dgs.eval.report import table, update_metrics
from room2dgs.eval.surface import Surface
from room2dgs.eval.upright import up_axis
from room2dgs.mesh.io import write_mesh

PROTOCOLS: dict[str, Callable[..., Result]] = {"area": area, "neuris": neuris, "manhattan": manhattan}
HEADLINE = ("f_score", "precision", "recall")
COARSE_EDGE_M = 0.04  # protocols that compare vertices need a ground truth about as dense as its 2 cm cells


def evaluate(
    pred: Path, gt: Path, scene: Scene, config: EvalConfig, out: Path, log: Callable[[str], None]
) -> dict[str, Any]:
    """Score `pred` by every protocol of `eval.protocols`.

    Writes into `out`: the mesh part of metrics.json (other keys there stay), eval/error.ply (the prediction
    coloured by its distance to the ground truth), eval/views.png and eval/top.png.

    Returns:
        The mesh part: the first protocol's accuracy_m, completion_m, chamfer_m, normal_consistency,
        f_score_5cm, precision_5cm, recall_5cm and "protocol"; "protocols": name -> all its scores and
        "constants"; "where_the_error_sits" (with protocol `area`); "eval_seconds": stage -> seconds.

    Raises:
        InputError: a mesh is missing or unusable, or no protocol is named.
    """
    if not config.protocols:
        raise InputError("eval.protocols is empty; name at least one of " + ", ".join(PROTOCOLS))
    pred_file, gt_file = load(pred), load(gt)
    cameras = [frame.camera for frame in scene.frames]
    seconds: dict[str, float] = {}
    results = {}
    for name in config.protocols:
        start = time.perf_counter()
        results[name] = PROTOCOLS[name](pred_file, gt_file, cameras, config)
        seconds[name] = time.perf_counter() - start
        _warn_if_coarse(results[name], gt, log)
    part: dict[str, Any] = {
        **_headline(results[config.protocols[0]], config.threshold_m),
        "protocols": {name: result.as_dict() for name, result in results.items()},
    }
    start = time.perf_counter()
    pred_surface, gt_surface = Surface(pred_file.mesh), Surface(gt_file.mesh)
    if "area" in results:
        sites = where_the_error_sits(results["area"], pred_surface, gt_surface, cameras)
        part["where_the_error_sits"] = sites
    _draw(pred_file, gt_file, pred_surface, gt_surface, scene, results, config, Path(out) / "eval")
    seconds["pictures"] = time.perf_counter() - start
    part["eval_seconds"] = seconds
    update_metrics(Path(out) / "metrics.json", part)
    log(table(part["protocols"], threshold_name(config.threshold_m)))
    for line in sentences(part["where_the_error_sits"]) if "area" in results else ():
        log(line)
    return part


def _headline(result: Result, threshold_m: float) -> dict[str, Any]:
    """The scores that stand at the top of metrics.json: at the chosen threshold alone."""
    name = threshold_name(threshold_m)
    values = result.scores.as_dict()
    keys = [key for key in values if not key.startswith(HEADLINE) or key.endswith(f"_{name}")]
    return {"protocol": result.protocol, **{key: values[key] for key in keys}}


def _warn_if_coarse(result: Result, gt: Path, log: Callable[[str], None]) -> None:
    edge = result.constants.get("gt_edge_m", 0.0)
    if edge > COARSE_EDGE_M:
        log(
            f"warning: protocol {result.protocol} compares vertices, but the faces of {gt} are {edge * 100:.0f} cm "
            "long; its scores say little, read those of protocol area"
        )


def _draw(
    pred: MeshFile,
    gt: MeshFile,
    pred_surface: Surface,
    gt_surface: Surface,
    scene: Scene,
    results: dict[str, Result],
    config: EvalConfig,
    folder: Path,
) -> None:
    frames, cameras = scene.frames, [frame.camera for frame in scene.frames]
    area_result = results.get("area")
    normals = area_result.gt.normals if isinstance(area_result, AreaResult) else gt_surface.face_normals
    threshold = config.threshold_m
    write_mesh(folder / "error.ply", pictures.error_mesh(pred.mesh, gt_surface, threshold))
    rows = pictures.inside_rows(pred.mesh, pred_surface, gt_surface, frames, threshold)
    pictures.write_sheet(folder / "views.png", rows, ("photo", *pictures.COLUMNS), threshold)
    row = pictures.top_row(pred.mesh, pred_surface, gt_surface, gt.mesh, cameras, up_axis(cameras, normals), threshold)
    pictures.write_sheet(folder / "top.png", [row], pictures.COLUMNS, threshold)
