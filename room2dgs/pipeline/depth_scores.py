"""Scores by protocol `depth`: a mesh, and rendered surfels, against the capture's own depth maps."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log, in_lines
from room2dgs.pipeline.same_depth import used_own_depth
from room2dgs.pipeline.surfels import render_frames

if TYPE_CHECKING:
    from room2dgs.eval.protocol_depth import DepthOf, DepthView
    from room2dgs.primitives.primitive import Splats


def depth_figures(
    mesh: Path, scene: Scene, surfels: Splats | None, config: Config, depth_source: str, log: Log
) -> dict[str, Any]:
    """For metrics.json: "depth_scores" with scores of the "mesh" and, where given, of the rendered "surfels".

    Empty, and the log says why, if no photo has a depth map.

    Args:
        mesh: file in the capture's world.
        scene: with the poses that the mesh was made with.
        depth_source: what the run's metrics.json says; "" if no run made the mesh.

    Raises:
        InputError: the mesh cannot be read.
    """
    from room2dgs.eval.protocol import load
    from room2dgs.eval.protocol_depth import THRESHOLDS_M, depth, depth_table, mesh_depth

    views = _views(scene, config, log)
    if not views:
        log(
            f"protocol depth: no photo of {scene.path} has a depth map to compare with; the depth is not scored "
            "(eval.protocols without depth asks for none)"
        )
        return {}
    if not scene.metric:
        log("WARNING: protocol depth compares metres with the capture's unit, which is not known to be metres")
    loaded = load(mesh, scene.origin_m)
    surfaces: dict[str, DepthOf] = {"mesh": mesh_depth(loaded)}
    if surfels is not None:
        surfaces["surfels"] = _surfel_depth(surfels, scene, config)
    figures: dict[str, Any] = {}
    for name, depth_of in surfaces.items():
        scores = depth(depth_of, views)
        in_lines(log, depth_table(scores.groups, name))
        figures[name] = scores.as_dict()
    same = used_own_depth([frame for frame in scene.frames if frame.depth_path], config, depth_source)
    if same:
        log(
            "NOTE: this run used the very depth maps that it is compared with: protocol depth says nothing of photos "
            "alone (those: prior=room_prior)"
        )
    constants = {
        "thresholds_m": list(THRESHOLDS_M),
        "size": list(views[0].camera.size),
        "views": len(views),
        "run_used_this_depth": same,
        "pred_sha256": loaded.sha256,
    }
    return {"depth_scores": {**figures, "constants": constants}}


def _views(scene: Scene, config: Config, log: Log) -> list[DepthView]:
    """Photos whose depth map can be read; the log says of how many it cannot."""
    from room2dgs.eval.protocol_depth import DepthView

    held_out = {frame.name for frame in scene.test}
    views, unread = [], []
    for frame in scene.frames:
        if frame.depth_path is None:
            continue
        try:
            measured = _measured(frame, config)
        except InputError as error:
            unread.append(str(error))
            continue
        if measured.any():
            views.append(DepthView(frame.name, frame.camera, partial(_measured, frame, config), frame.name in held_out))
    if unread:
        log(
            f"WARNING: protocol depth: {len(unread)} depth maps cannot be read and are left out; the first: {unread[0]}"
        )
    return views


def _measured(frame: Frame, config: Config) -> np.ndarray:
    """(H, W) float32 metres; 0 where the sensor measured nothing or the photo's mask excludes the pixel."""
    from room2dgs.depth.sensor.maps import sensor_depth

    depth, mask = sensor_depth(frame, config.prior.depth), frame.mask()
    return depth if mask is None else np.where(mask, depth, np.float32(0))


def _surfel_depth(surfels: Splats, scene: Scene, config: Config) -> DepthOf:
    frames = {frame.name: frame for frame in scene.frames}

    def depth_of(view: DepthView) -> np.ndarray:
        (_, rendering), *_ = render_frames(surfels, [frames[view.name]], config)
        return rendering.covered_depth().numpy()

    return depth_of
