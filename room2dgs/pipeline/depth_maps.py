"""Dense depth of a capture's photos by stereo: maps, a point cloud, a mesh and a page of coverage."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config
from room2dgs.files import whole_file
from room2dgs.pipeline.depth import fill_depth
from room2dgs.pipeline.exposure import with_even_exposure
from room2dgs.pipeline.meshers.depth import views_with_depth
from room2dgs.pipeline.points import find_points, gives_metres
from room2dgs.pipeline.poses import refine_poses
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import photos_cached, read_capture
from room2dgs.pipeline.stereo import find_stereo, fused_stereo, resized_photos
from room2dgs.pipeline.surfels import use_threads
from room2dgs.pipeline.units import unit_in_no_surface
from room2dgs.runs.folder import MESH, claimed
from room2dgs.runs.metrics import StageTimes, timed

if TYPE_CHECKING:
    from room2dgs.depth import StereoViews
    from room2dgs.mesh.views import FusedView

CLOUD = "dense.ply"
MAPS = ("depth", "normal", "error", "num_consistent")
FILLED = {"filled": "depth", "filled_confidence": "depth_confidence"}  # folder -> field of `ViewMaps`
Filled = Mapping[str, ViewMaps[np.ndarray]]  # by the name of the view; empty: nothing is filled


def depth_of_capture(config: Config, fill: bool = False) -> None:
    """Compares the photos of a capture with each other, and writes what is found to config.out.

    Args:
        fill: with the prior's depth where stereo finds none.

    Raises:
        InputError: as `read_scene`, `refine_poses`, `sparse_points`, `scene_stereo` and `estimate_depth`.
    """
    times = StageTimes()
    with timed(times, "read"):
        scene = read_capture(config, keep_photos=True)
    with claimed(config) as out, photos_cached(scene, out):
        write_depth_maps(scene, config, RunFolder.with_log(out, times), fill)


def write_depth_maps(scene: Scene, config: Config, run: RunFolder, fill: bool = False) -> None:
    """Maps of each photo, dense.ply, mesh.ply, coverage.json and report.html.

    Args:
        scene: with the poses that the capture brings.
        fill: with the prior's depth where stereo finds none.

    Raises:
        InputError: as `refine_poses`, `sparse_points`, `scene_stereo` and `estimate_depth`.
    """
    from room2dgs.sfm.sparse import MayLack

    use_threads(config)
    scene = refine_poses(scene, config, run, with_priors=fill)
    may_lack = MayLack.WITH_METRES if fill and gives_metres(config) else MayLack.IN_ONE_PLACE
    points = find_points(scene, config, run, may_lack=may_lack)
    stereo, share = find_stereo(scene, points, config, run)
    priors = fill_depth(scene, points, stereo, config, run) if fill else None
    filled: Filled = priors.by_frame if priors else {}
    own = {frame.name: ViewMaps(depth=view.depth) for frame, view in zip(scene.keyframes, stereo.views, strict=True)}
    scene = with_even_exposure(scene, points, filled or own, config, run)
    with run.timed("write"):
        _write_maps(run.path, scene.keyframes, stereo, filled)
        count = _write_cloud(run.path, scene, stereo, config.stereo.cell_m)
    run.log(f"points: {run.path / CLOUD}, {count:,}")
    if share or any(one.depth is not None for one in filled.values()):
        views = views_with_depth(scene, priors, config) if priors else fused_stereo(scene.keyframes, stereo)
        with run.timed("mesh"):
            _write_mesh(views, scene, config, run)
    source = priors.depth_source if priors else "none"
    run.record({"stereo_coverage": round(share, 4), "dense_points": count, "depth_source": source})
    _write_report(scene, stereo, filled, config, run)


def _write_mesh(views: Iterable[FusedView], scene: Scene, config: Config, run: RunFolder) -> None:
    """mesh.ply; a warning where the depth is too little for a surface, which maps, cloud and report still show."""
    from room2dgs.mesh.coloring.vertices import photo_colored
    from room2dgs.mesh.fuse import NoSurface, fuse
    from room2dgs.mesh.voxel import with_voxel
    from room2dgs.mesh.world import write_in_world

    settings = with_voxel(config.mesh, [frame.camera for frame in scene.keyframes])
    settings = replace(settings, source="depth")  # there are no surfels here, whatever a run would mesh
    try:
        with unit_in_no_surface(scene, config, run.path):
            mesh = fuse(views, settings, run.log, config.render.device)
    except NoSurface as error:
        run.log(f"WARNING: no mesh: {error}")
        return
    mesh, _ = photo_colored(mesh, scene.train)
    write_in_world(run.path / MESH, mesh, scene.origin_m)
    run.log(f"mesh: {run.path / MESH}")


def _write_report(scene: Scene, stereo: StereoViews, filled: Filled, config: Config, run: RunFolder) -> None:
    """coverage.json, and report.html if it is wanted."""
    from room2dgs.runs.depth_coverage import photo_coverage, write_coverage
    from room2dgs.runs.page.depth import write_depth_report

    photos = [
        photo_coverage(frame.name, view, filled.get(frame.name))
        for frame, view in zip(scene.keyframes, stereo.views, strict=True)
    ]
    write_coverage(run.path, photos, run.times)
    if config.report.enabled:
        page = write_depth_report(scene, stereo.views, filled, photos, config, run.path)
        run.log(f"report: {page}")


def _write_cloud(out: Path, scene: Scene, stereo: StereoViews, cell_m: float) -> int:
    """dense.ply; the number of its points."""
    from room2dgs.stereo.cloud import fused_cloud, ply_bytes

    photos = resized_photos(scene.keyframes, stereo.cameras)
    pixels = (
        (camera, view.depth, view.normal, color)
        for camera, view, color in zip(stereo.cameras, stereo.views, photos, strict=True)
    )
    cloud = fused_cloud(pixels, cell_m)
    with whole_file(out / CLOUD) as temporary:
        temporary.write_bytes(ply_bytes(cloud, scene.origin_m))
    return len(cloud.xyz)


def _write_maps(out: Path, frames: Sequence[Frame], stereo: StereoViews, filled: Filled) -> None:
    for name in MAPS:
        for frame, view in zip(frames, stereo.views, strict=True):
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
