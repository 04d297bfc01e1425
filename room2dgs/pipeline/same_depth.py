"""Marks scores whose ground truth was made from the depth that the run used."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config
from room2dgs.logs import Log

if TYPE_CHECKING:
    from room2dgs.mesh.views import FusedView

VIEWS = 60


def same_depth_figures(scene: Scene, gt: Path, config: Config, depth_source: str, log: Log) -> dict[str, Any]:
    """For metrics.json: "truth_from_same_depth", and "depth_to_truth_m" where the run used the capture's own depth.

    A truth that lies where the depth lies (`SAME_M`) is taken for made from it: nothing in a capture says otherwise.

    Args:
        depth_source: what the run's metrics.json says.
    """
    frames = [frame for frame in scene.train if frame.depth_path]
    if not frames or not used_own_depth(frames, config, depth_source):
        return {"truth_from_same_depth": False, "depth_to_truth_m": None}
    from room2dgs.eval.protocol import load
    from room2dgs.eval.same_depth import SAME_M, distance_to_truth

    distance = distance_to_truth(
        _views(frames[:: max(1, len(frames) // VIEWS)], config), load(gt, scene.origin_m), config.mesh
    )
    same = distance <= SAME_M
    if same:
        log(
            f"NOTE: the ground truth lies {1000 * distance:.1f} mm from the depth that this run used (median), so it "
            "was made from it or is as exact: compare no score of photos alone with this one (those: prior=room_prior)"
        )
    return {"truth_from_same_depth": same, "depth_to_truth_m": distance if np.isfinite(distance) else None}


def used_own_depth(frames: Sequence[Frame], config: Config, depth_source: str) -> bool:
    """Whether a run was given the depth maps of these photos; all of them have one.

    Args:
        depth_source: what the run's metrics.json says.
    """
    own = frames[0].depth_path
    if depth_source == "files" and config.prior.depth.path and own:
        return Path(config.prior.depth.path).resolve() == own.resolve().parent
    return depth_source == "sensor"


def _views(frames: Sequence[Frame], config: Config) -> Iterator[FusedView]:
    from room2dgs.depth.sensor.maps import sensor_depth
    from room2dgs.errors import InputError
    from room2dgs.mesh.views import FusedView

    for frame in frames:
        try:
            depth = sensor_depth(frame, config.prior.depth)
        except InputError:  # the run went on without it
            continue
        yield FusedView(frame.camera, depth, np.zeros((*depth.shape, 3), np.uint8))
