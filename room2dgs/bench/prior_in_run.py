"""How good the depth is that training gets: maps aligned to the sparse points, then optimised jointly."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from room2dgs.bench.prior_scores import depth_score
from room2dgs.bench.prior_truth import true_depth
from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config, DepthPriorConfig
from room2dgs.depth import estimate_depth
from room2dgs.logs import Log
from room2dgs.sfm.sparse import sparse_points

CLOSE_M = 0.05


@dataclass(frozen=True)
class DepthInRun:
    """The depth of all views, in metres as it is: nothing is fitted to the truth.

    Attributes:
        abs_rel, delta1: each view's, then their mean; NaN if no view has any.
        within_5cm: share of a view's pixels with depth that are that close to the truth, likewise: what a mesh can get.
        share: of the pixels whose truth is known, those that have depth, over all views.
    """

    abs_rel: float
    delta1: float
    within_5cm: float
    share: float


def depth_in_run(config: Config, log: Log) -> dict[str, DepthInRun]:
    """Depth as a run of these settings has it, after the alignment and after the joint optimisation.

    Returns:
        "aligned", and with prior.depth.joint "optimised", which training gets; nothing without a depth prior.

    Raises:
        InputError: as `read_scene`, `sparse_points` and `estimate_depth`.
    """
    if config.prior.depth.source == "none":
        return {}
    scene = read_scene(config.scene)
    frames = [frame for frame in scene.train if frame.depth_path]
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        points = sparse_points(scene, config.points, Path(config.points.cache or scratch), log)
        for name, depth in _steps(config.prior.depth).items():
            settings = replace(config, prior=replace(config.prior, depth=depth))
            found[name] = _score(frames, estimate_depth(scene, points, settings, Path(scratch) / "maps", log).by_frame)
    return found


def _steps(settings: DepthPriorConfig) -> dict[str, DepthPriorConfig]:
    steps = {"aligned": replace(settings, joint=False)}
    return steps | ({"optimised": settings} if settings.joint else {})


def _score(frames: Sequence[Frame], priors: Mapping[str, ViewMaps]) -> DepthInRun:
    scores, close, known, with_depth = [], [], 0, 0
    for frame in frames:
        truth = true_depth(frame)
        known += int(np.count_nonzero(truth))
        depth = priors[frame.name].depth if frame.name in priors else None
        if depth is None:
            continue
        valid = (truth > 0) & (depth > 0)
        with_depth += int(np.count_nonzero(valid))
        if valid.any():
            scores.append(depth_score(depth[valid], truth[valid]))
            close.append(float((np.abs(depth[valid] - truth[valid]) < CLOSE_M).mean()))
    return DepthInRun(
        abs_rel=_mean([score.abs_rel for score in scores]),
        delta1=_mean([score.delta1 for score in scores]),
        within_5cm=_mean(close),
        share=with_depth / max(1, known),
    )


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else float("nan")
