"""A predicted mesh against the true one: scores by every protocol, and where the error sits."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import trimesh

from room2dgs.errors import InputError
from room2dgs.eval.error_sites import sentences, where_the_error_sits
from room2dgs.eval.geometry_scores import Scores, threshold_name
from room2dgs.eval.protocol import MeshFile, Options, Result, load
from room2dgs.eval.protocol_area import AreaResult
from room2dgs.eval.report import table
from room2dgs.geometry.camera import Camera
from room2dgs.registries.protocols import MESH, PROTOCOLS, against

HEADLINE = ("f_score", "precision", "recall")
MOST_SAMPLES = 100_000_000
COARSE_EDGE_M = 0.04  # protocols that compare vertices need a ground truth about as dense as its 2 cm cells

Mesh: TypeAlias = str | Path | trimesh.Trimesh | MeshFile


@dataclass(frozen=True)
class Evaluation:
    """Result of `evaluate`.

    Attributes:
        pred, gt: the meshes.
        options: what the protocols were given.
        results: protocol's name -> its scores and constants, in the order asked for.
        error_sites: see `where_the_error_sits`; None without protocol `area`.
        seconds: protocol's name -> seconds.
    """

    pred: MeshFile
    gt: MeshFile
    options: Options
    results: dict[str, Result]
    error_sites: dict[str, Any] | None
    seconds: dict[str, float]

    @property
    def scores(self) -> Scores:
        """Of the first protocol."""
        return next(iter(self.results.values())).scores

    def as_dict(self) -> dict[str, Any]:
        """Plain values for metrics.json.

        The first protocol's accuracy_m, completion_m, chamfer_m, normal_consistency, and f_score_5cm, precision_5cm,
        recall_5cm at the threshold alone; "protocol": its name; "threshold_m"; "protocols": name -> all its scores and
        "constants"; "where_the_error_sits" with protocol `area`; "eval_seconds": stage -> seconds.
        """
        at = threshold_name(self.options.threshold_m)
        top = {
            key: value
            for key, value in self.scores.as_dict().items()
            if not key.startswith(HEADLINE) or key.endswith(f"_{at}")
        }
        sites = {} if self.error_sites is None else {"where_the_error_sits": self.error_sites}
        protocols = {name: result.as_dict() for name, result in self.results.items()}
        return {
            "protocol": next(iter(self.results)),
            "threshold_m": self.options.threshold_m,
            **top,
            "protocols": protocols,
            **sites,
            "eval_seconds": self.seconds,
        }

    def lines(self) -> list[str]:
        """For a terminal: warnings, a table of the protocols side by side, where the error sits."""
        scores = {name: result.as_dict() for name, result in self.results.items()}
        sites = [] if self.error_sites is None else sentences(self.error_sites)
        return [*self._warnings(), table(scores, threshold_name(self.options.threshold_m)), *sites]

    def _warnings(self) -> list[str]:
        return [
            f"warning: protocol {name} compares vertices, but the faces of {self.gt.path or 'the ground truth'} are "
            f"{result.constants['gt_edge_m'] * 100:.0f} cm long; its scores say little, read those of protocol area"
            for name, result in self.results.items()
            if result.constants.get("gt_edge_m", 0.0) > COARSE_EDGE_M
        ]


def evaluate(
    pred: Mesh,
    gt: Mesh,
    cameras: Sequence[Camera],
    protocols: Sequence[str] = ("area",),
    *,
    threshold_m: float = 0.05,
    samples: int = 200_000,
    seed: int = 0,
) -> Evaluation:
    """Score a mesh against the ground truth. The same input gives the same scores.

    Args:
        pred, gt: a mesh file (PLY, OBJ, OFF, STL, GLB) or a mesh; metres, one world frame.
        cameras: all usable views of the scene; only what they see is judged.
        protocols: names out of `PROTOCOLS`, of those that compare with a mesh.
        threshold_m: of precision, recall and F-score.
        samples, seed: protocol `area`: observed points on each mesh (at most 100 million), and the seed that draws
            them.

    Raises:
        InputError: a mesh is missing or unusable, there is no camera, no protocol or an unknown one is named, or an
            option cannot be.
    """
    if not protocols:
        raise InputError(f"no protocol is named; choose from {', '.join(PROTOCOLS)}")
    of_meshes = against(MESH, protocols)
    if len(of_meshes) < len(protocols):
        other = ", ".join(name for name in protocols if name not in of_meshes)
        raise InputError(f"protocol {other} does not compare two meshes; `evaluate` knows the others")
    chosen = {name: PROTOCOLS.load(name) for name in of_meshes}
    if not len(cameras):
        raise InputError("there is no camera; protocols judge only what cameras see")
    if not 0 < threshold_m < float("inf"):
        raise InputError(f"threshold_m={threshold_m} is impossible; give metres above 0")
    if not 1 <= samples <= MOST_SAMPLES or samples != int(samples):
        raise InputError(f"samples={samples} is impossible; give a whole number from 1 to {MOST_SAMPLES}")
    pred_file, gt_file = load(pred), load(gt)
    options = Options(threshold_m, samples, seed)
    results: dict[str, Result] = {}
    seconds: dict[str, float] = {}
    for name, protocol in chosen.items():
        start = time.perf_counter()
        results[name] = protocol(pred_file, gt_file, cameras, options)
        seconds[name] = time.perf_counter() - start
    sites = None
    if isinstance(found := results.get("area"), AreaResult):
        start = time.perf_counter()
        sites = where_the_error_sits(found, pred_file.surface, gt_file.surface, cameras)
        seconds["where_the_error_sits"] = time.perf_counter() - start
    return Evaluation(pred_file, gt_file, options, results, sites, seconds)
