"""Expected and true errors of each source of depth and normals on a capture, as a run of the settings has them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from room2dgs.bench.prior_scores import angles_deg
from room2dgs.bench.prior_truth import Truth, frame_truth, truth_source
from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.uncertainty import completed_sigma
from room2dgs.config import ONE_PHOTO_SOURCES, Config, PriorConfig
from room2dgs.depth import Priors, StereoViews, estimate_depth
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.completion.on_planes import on_planes
from room2dgs.depth.completion.restore import LEAST_CONSISTENT
from room2dgs.depth.files import read_depth, read_normal
from room2dgs.depth.network.map_cache import read_array
from room2dgs.depth.network.maps import predicted_maps, read_models
from room2dgs.depth.normals.convention import camera_normals
from room2dgs.depth.sensor.maps import sensor_map
from room2dgs.errors import InputError
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.mesh.world import read_in_scene
from room2dgs.sfm.sparse import sparse_points
from room2dgs.splat import set_threads
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.scene import scene_stereo
from room2dgs.tools.calibration.bins import Calibration, Errors, calibration

ON_PLANE = 0.5  # trust in a plane from which on a pixel is counted as the plane's
RENDERED = 5e-4  # of the depth: a median error below it is of depth that was made of the mesh, and no camera's
STEREO, NETWORK, SENSOR = "stereo", "network, aligned", "sensor"
AT_STEREO, AT_PLANES, FILLED = "completed, stereo", "completed, planes", "completed, other"


def calibrations(config: Config, log: Log) -> tuple[str, list[Calibration]]:
    """Every source on one capture: stereo; the network, aligned to points and stereo; completed depth where stereo,
    planes or neither hold it; the capture's depth camera; normals of stereo and network.

    Returns:
        Where the true normals come from (`truth_source`), and the sources that have any pixel.

    Raises:
        InputError: the capture has no depth, or as `read_scene`, `sparse_points`, `scene_stereo` and `estimate_depth`.
    """
    scene = read_scene(config.scene)
    frames = [frame for frame in scene.train if frame.depth_path]
    if not frames:
        raise InputError(f"{scene.path} has no depth to measure against; add a depth folder")
    surface = Surface(read_in_scene(scene.gt_mesh, scene.origin_m)) if scene.gt_mesh else None
    source = truth_source(frames, surface)
    set_threads(config.render.threads)
    parts: dict[tuple[str, str], list[Errors]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        cache = Path(scratch if config.out == "" else config.out)
        for frame, sources in _sources(scene, config, cache, log):
            if frame.depth_path:
                truth = frame_truth(frame, surface, source)
                for one in (*sources(truth), *_sensor(frame, surface, source, config)):
                    parts.setdefault((one.kind, one.source), []).append(one)
    found = [calibration(part) for _, part in sorted(parts.items(), key=lambda item: item[0][0])]
    return source, [one for one in found if one is not None and not (one.source == SENSOR and one.median < RENDERED)]


Sources = Callable[[Truth], Iterator[Errors]]


def _sources(scene: Scene, config: Config, cache: Path, log: Log) -> Iterator[tuple[Frame, Sources]]:
    """Each training view and what gives the errors of its maps."""
    frames = scene.train
    points = sparse_points(scene, config.points, Path(config.points.cache or cache / "points"), log)
    prior = replace(config.prior, cache=config.prior.cache or str(cache / "maps"))
    cameras, found = scene_stereo(frames, points, config.stereo, log, config.render.device)
    views = list(found)
    found_already = StereoViews(cameras, views) if config.prior.depth.passes == 1 else None
    priors = estimate_depth(scene, points, replace(config, prior=prior), cache / "maps", log, stereo=found_already)
    files = _network_files(frames, prior)
    for frame, view in zip(frames, views, strict=True):

        def sources(truth: Truth, frame: Frame = frame, view: DenseView = view) -> Iterator[Errors]:
            resized = _at(view, frame.camera)
            yield from _stereo(resized, frame.camera, truth)
            yield from _network(frame, files, priors.fits.get(frame.name), prior, truth)
            held = _at(view._replace(num_consistent=priors.stereo.get(frame.name, view).num_consistent), frame.camera)
            yield from _completed(frame, held, priors, truth)

        yield frame, sources


def _network_files(frames: Sequence[Frame], prior: PriorConfig) -> dict[str, Mapping[str, Path]]:
    """ "depth" and "normal", where a network of one photo makes them, -> frame name -> its map, from the cache."""
    models = read_models(prior)
    return {
        kind: predicted_maps(frames, kind, prior, models, lambda line: None)
        for kind in models
        if getattr(prior, kind).source in ONE_PHOTO_SOURCES
    }


def _at(view: DenseView, camera: Camera) -> DenseView:
    """Stereo's maps at a camera's size, the nearest pixel each."""
    height, width = view.depth.shape
    if (width, height) == camera.size:
        return view
    row = ((np.arange(camera.height) + 0.5) * height / camera.height).astype(int)[:, None]
    column = ((np.arange(camera.width) + 0.5) * width / camera.width).astype(int)
    maps = {name: getattr(view, name)[row, column] for name in ("depth", "normal", "num_consistent", "error")}
    return view._replace(**maps)


def _stereo(view: DenseView, camera: Camera, truth: Truth) -> Iterator[Errors]:
    relative = np.divide(view.error, view.depth, out=np.zeros_like(view.error), where=view.depth > 0)
    yield _depth(STEREO, view.depth, relative, truth)
    yield _normal(STEREO, camera.turned_to_camera(view.normal), None, truth)


def _network(
    frame: Frame, files: Mapping[str, Mapping[str, Path]], fit: Fit | None, prior: PriorConfig, truth: Truth
) -> Iterator[Errors]:
    path = files.get("depth", {}).get(frame.name)
    if path is not None and fit is not None and prior.depth.meaning == "metric_depth":
        values, valid = read_depth(path, prior.depth, frame.camera)
        depth = np.where(valid, fit.scale * values + fit.shift, 0)
        error = read_array(path, "error")
        yield _depth(NETWORK, np.maximum(depth, 0), error, truth)
    path = files.get("normal", {}).get(frame.name)
    if path is not None:
        raw, valid = read_normal(path, prior.normal, frame.camera)
        normal = np.where(valid[..., None], camera_normals(raw, prior.normal, frame.camera), 0)
        error = read_array(path, "error")
        yield _normal("network", normal, None if error is None else np.degrees(error), truth)


def _completed(frame: Frame, view: DenseView, priors: Priors, truth: Truth) -> Iterator[Errors]:
    """The depth that training gets, by what holds it."""
    maps = priors.by_frame.get(frame.name)
    if maps is None or maps.depth is None or maps.depth_confidence is None:
        return
    sure = np.maximum(maps.depth_confidence, 1e-3)
    relative = np.where(maps.depth_confidence > 0, completed_sigma(sure), np.inf)
    by_stereo = view.num_consistent >= LEAST_CONSISTENT
    on_plane = np.zeros(by_stereo.shape, bool)
    if priors.planes and maps.normal is not None:
        on_plane = on_planes(maps.depth, maps.normal, frame.camera, priors.planes)[1] >= ON_PLANE
    for name, here in (
        (AT_STEREO, by_stereo),
        (AT_PLANES, on_plane & ~by_stereo),
        (FILLED, ~on_plane & ~by_stereo),
    ):
        yield _depth(name, np.where(here, maps.depth, 0), relative, truth)


def _sensor(frame: Frame, surface: Surface | None, source: str, config: Config) -> Iterator[Errors]:
    """A depth camera against the mesh, where there is one and it shows the same place."""
    if surface is None or source not in ("mesh", "fused mesh"):
        return
    depth, error = sensor_map(frame, config.prior.depth)
    cast = surface.seen_by(frame.camera).t.reshape(depth.shape)
    relative = np.divide(error, depth, out=np.full_like(error, np.inf), where=depth > 0)
    truth = Truth(np.where(np.isfinite(cast), cast, 0), np.zeros((*depth.shape, 3)))
    yield _depth(SENSOR, depth, relative, truth)


def _depth(source: str, depth: np.ndarray, relative: np.ndarray | None, truth: Truth) -> Errors:
    known = truth.depth > 0
    here = known & (depth > 0) & (True if relative is None else np.isfinite(relative))
    true = np.abs(depth[here] / truth.depth[here] - 1)
    expected = None if relative is None else relative[here].astype(np.float32)
    return Errors(source, "depth", expected, true.astype(np.float32), int(known.sum()))


def _normal(source: str, normal: np.ndarray, degrees: np.ndarray | None, truth: Truth) -> Errors:
    """Args: normal: (H, W, 3) unit, camera frame; 0 = none."""
    known = truth.normal.any(axis=-1)
    here = known & normal.any(axis=-1)
    true = angles_deg(normal[here], truth.normal[here])
    expected = None if degrees is None else degrees[here].astype(np.float32)
    return Errors(source, "normal", expected, true.astype(np.float32), int(known.sum()))
