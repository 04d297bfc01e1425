"""`room2dgs depth`: dense depth of a capture's photos by stereo, and a first mesh without any training."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.commands.filled_depth import filled, with_prior
from room2dgs.commands.mesh_of_depth import trusted_views
from room2dgs.commands.own_arguments import choices, own_arguments
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import cached, knows_metres, points_of_run, read, refined, use_threads
from room2dgs.commands.stereo_views import colors, fused_views, stereo_views
from room2dgs.commands.units import unit_named
from room2dgs.config import Config
from room2dgs.files import whole_file
from room2dgs.logs import Log, run_log
from room2dgs.runs.folder import MESH, claimed, new_run
from room2dgs.runs.metrics import Stages, record, timed

if TYPE_CHECKING:
    from room2dgs.geometry.camera import Camera
    from room2dgs.mesh.views import FusedView
    from room2dgs.stereo.dense import DenseView

USAGE = "room2dgs depth scene.path=DIR out=DIR [fill=true] [stereo.KEY=VALUE ...] [mesh.KEY=VALUE ...]"
CLOUD = "dense.ply"
MAPS = ("depth", "normal", "error", "agreeing")
FILLED = {"filled": "depth", "filled_confidence": "depth_confidence"}  # folder -> field of `ViewMaps`


def main(argv: list[str]) -> int:
    """Compare the photos with each other: depth, normals, expected errors and agreeing views of each, a coloured
    point cloud (dense.ply), a mesh of the depth alone (mesh.ply), and a report of coverage and time (report.html,
    coverage.json).

    Where photos tell no depth, of a camera that only turned, maps and cloud are empty and there is no mesh; report and
    coverage say so.

    The maps are .npy files called by the views' names (a photo's without its ending, with _ for folders): depth in
    metres (0 = none), unit normals in the world frame, errors in metres.
    `room2dgs run ... prior/depth=files prior.depth.path=OUT/depth prior.depth.align=false` trains with them.
    fill=true fills what stereo leaves empty with the network's depth (prior=room_prior), drawn to stereo's: filled/ and
    filled_confidence/ beside the others, and the mesh is of these.
    """
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("scene", "points", "stereo", "prior", "mesh", "report"))
    own, rest = own_arguments(argv, ("fill",))
    fills = choices(own, "fill", "false", ("true", "false")) == ("true",)
    config = new_run(with_prior(rest) if fills else rest)
    seconds = Stages()
    with timed(seconds, "read"):
        scene = read(config, keep=True)
    with claimed(config) as out, cached(scene, out):
        from room2dgs.sfm.sparse import MayLack

        log = run_log(out)
        use_threads(config)
        scene = refined(scene, config, out, log, seconds, with_priors=fills)
        may_lack = MayLack.WITH_METRES if fills and knows_metres(config) else MayLack.IN_ONE_PLACE
        points = points_of_run(scene, config, out, log, seconds, may_lack=may_lack)
        cameras, views, share = stereo_views(scene, points, config, log, seconds)
        priors = filled(scene, points, cameras, views, config, out, log, seconds) if fills else None
        maps = priors.by_frame if priors else {}
        with timed(seconds, "write"):
            _write_maps(out, scene.keyframes, views, maps)
            count = _write_cloud(out, scene, cameras, views, config.stereo.cell_m)
        log(f"points: {out / CLOUD}, {count:,}")
        if share or any(one.depth is not None for one in maps.values()):
            depths = trusted_views(scene, priors, config) if priors else fused_views(scene.keyframes, cameras, views)
            with timed(seconds, "mesh"):
                _write_mesh(depths, scene, config, out, log)
        part = {
            "stereo_coverage": round(share, 4),
            "dense_points": count,
            "depth_source": priors.depth_source if priors else "none",
        }
        record(out, part, seconds)
        _report(scene, views, maps, seconds, config, out, log)
    return 0


def _write_mesh(views: Iterable[FusedView], scene: Scene, config: Config, out: Path, log: Log) -> None:
    """mesh.ply; a warning where the depth is too little for a surface, which maps, cloud and report still show."""
    from room2dgs.mesh.fuse import NoSurface, fuse
    from room2dgs.mesh.voxel import with_voxel
    from room2dgs.mesh.world import write_in_world

    settings = with_voxel(config.mesh, [frame.camera for frame in scene.keyframes])
    settings = replace(settings, source="depth")  # there are no surfels here, whatever a run would mesh
    try:
        with unit_named(scene, config, out):
            mesh = fuse(views, settings, log, config.render.device)
    except NoSurface as error:
        log(f"WARNING: no mesh: {error}")
        return
    write_in_world(out / MESH, mesh, scene.origin_m)
    log(f"mesh: {out / MESH}")


def _report(
    scene: Scene,
    views: Sequence[DenseView],
    maps: Mapping[str, ViewMaps[np.ndarray]],
    seconds: Stages,
    config: Config,
    out: Path,
    log: Log,
) -> None:
    """coverage.json, and report.html if it is wanted."""
    from room2dgs.runs.depth_coverage import photo_coverage, write_coverage
    from room2dgs.runs.page.depth import write_depth_report

    photos = [
        photo_coverage(frame.name, view, maps.get(frame.name))
        for frame, view in zip(scene.keyframes, views, strict=True)
    ]
    write_coverage(out, photos, seconds)
    if config.report.enabled:
        log(f"report: {write_depth_report(scene, views, maps, photos, config, out)}")


def _write_cloud(out: Path, scene: Scene, cameras: Sequence[Camera], views: Sequence[DenseView], cell_m: float) -> int:
    """dense.ply; the number of its points."""
    from room2dgs.stereo.cloud import fused_cloud, ply_bytes

    pixels = (
        (camera, view.depth, view.normal, color)
        for camera, view, color in zip(cameras, views, colors(scene.keyframes, cameras), strict=True)
    )
    cloud = fused_cloud(pixels, cell_m)
    with whole_file(out / CLOUD) as temporary:
        temporary.write_bytes(ply_bytes(cloud, scene.origin_m))
    return len(cloud.xyz)


def _write_maps(
    out: Path, frames: Sequence[Frame], views: Sequence[DenseView], filled: Mapping[str, ViewMaps[np.ndarray]]
) -> None:
    for name in MAPS:
        for frame, view in zip(frames, views, strict=True):
            _save(out / name / f"{frame.name}.npy", getattr(view, name))
    for frame in frames:
        for name, field in FILLED.items():
            maps = filled.get(frame.name)
            if maps is not None and getattr(maps, field) is not None:
                _save(out / name / f"{frame.name}.npy", getattr(maps, field))


def _save(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    buffer = io.BytesIO()
    np.save(buffer, values)
    with whole_file(path) as temporary:
        temporary.write_bytes(buffer.getvalue())
