"""From a video or a folder of photos to a capture with poses, points and metric scale."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.assemble import assembled
from room2dgs.captures.capture import W2C_OPENCV, Capture
from room2dgs.captures.colmap_model import read_model
from room2dgs.captures.readers.colmap import model_shots
from room2dgs.captures.scene import Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.colmap import pycolmap
from room2dgs.config import Config, PrepareConfig
from room2dgs.errors import InputError
from room2dgs.files import whole_file, whole_folder
from room2dgs.json_files import plain
from room2dgs.logs import Log
from room2dgs.prepare.contradictions import contradictions
from room2dgs.prepare.features import descriptors, extracted, matched, new_database, verified_pairs
from room2dgs.prepare.focal import Focal, focal_doubt, focal_from_dict, turn_deg
from room2dgs.prepare.mapping import mapped, names_of, triangulation_angles
from room2dgs.prepare.metres import (
    NETWORK_SIGMA,
    SENSOR_SIGMA,
    Scale,
    height_over_floor,
    scale_by_length,
    scale_by_maps,
)
from room2dgs.prepare.one_place import MIN_MATCHES, hardly_walked, walked, why_no_parallax, why_small_angles
from room2dgs.prepare.pairs import all_pairs, loop_pairs, sequential_pairs
from room2dgs.prepare.photos import ChosenPhoto, choose_photos
from room2dgs.prepare.picture import draw_path
from room2dgs.prepare.progress import Progress
from room2dgs.prepare.similar import similarity
from room2dgs.prepare.sources import depth_files, network_depths, sensor_depths
from room2dgs.prepare.stage_cache import StageCache, key_of
from room2dgs.prepare.starts import best_start
from room2dgs.prepare.vanishing_points import RoomFrame, room_frame
from room2dgs.prepare.verdict import (
    FEW_POINTS,
    doubts,
    scale_dict,
    scale_doubt,
    upright_line,
    verdict_lines,
    weak_stretches,
)

VERDICT, PICTURE, WORK = "prepare.json", "camera_path.png", "work"
IMAGES, SPARSE, DEPTH = "images", "sparse", "depth"
TURNED_PHOTOS = 40  # whose edges tell how the room stands
MIN_ANGLE_DEG = 1.5  # under which the median point is seen: below that nothing is known of depths
FEW_FEATURES = 40  # of the median photo


def prepare(config: Config, out: Path, log: Log) -> dict[str, Any]:
    """Make a capture in `out` that `scene.path=out` reads: images/, sparse/0/ and prepare.json with the verdict.

    Finished stages lie in out/work; the same call goes on after the last of them. The same photos and settings give
    the same capture.

    Raises:
        InputError: what was given cannot be used, or no reconstruction comes of it; the sentence says why.
    """
    settings, work = config.prepare, out / WORK
    stages, images, database = StageCache(work), out / IMAGES, out / WORK / "database.db"
    photos, key = choose_photos(settings, images, stages, log)
    (out / VERDICT).unlink(missing_ok=True)  # it is written last, and says that all is whole
    camera = settings.lens, config.scene.intrinsics, config.scene.pixel_centres
    key = key_of(key, *camera, settings.features, settings.peak_threshold, settings.feature_side)
    model_key = key_of(key, settings.exhaustive, settings.overlap, settings.loops)
    features, found = stages.found("features", key), stages.found("model", model_key)
    if features is None or found is None or not (work / "model").is_dir():
        features = _features(photos, key, config, stages, images, database, log)
        found = _model(photos, model_key, config, stages, images, database, log)
    else:
        log("features, matches and model are there from before")
    key = model_key
    model = pycolmap.Reconstruction(work / "model")
    scene = _scene(out, work / "model", config)
    room = _room(scene, key, stages, log)
    scale = _scale(scene, room, photos, config, key, stages, log)
    return _written(out, model, photos, features["count"], found, room, scale, settings, log)


def _features(
    photos: Sequence[ChosenPhoto],
    key: str,
    config: Config,
    stages: StageCache,
    images: Path,
    database: Path,
    log: Log,
) -> dict[str, Any]:
    if stages.found("database", key) is None or not database.is_file():
        new_database(database, photos, config.prepare, config.scene.intrinsics, config.scene.pixel_centres != "integer")
        stages.finished("database", key, {})
    count = extracted(database, images, photos, config.prepare, log)
    if np.median(count) < FEW_FEATURES:
        raise InputError(
            f"{_source(config.prepare)} shows hardly anything to recognise ({np.median(count):.0f} features a photo); "
            "film with more light and texture in the picture"
        )
    return stages.finished("features", key, {"count": count})


def _model(
    photos: Sequence[ChosenPhoto],
    key: str,
    config: Config,
    stages: StageCache,
    images: Path,
    database: Path,
    log: Log,
) -> dict[str, Any]:
    """The reconstruction in the unit that pycolmap gives it, in work/model; what was left out."""
    settings, work = config.prepare, stages.folder
    pairs = _pairs(photos, key, settings, stages, database, log)
    matched(database, photos, pairs, work, settings, log)
    known = config.scene.intrinsics is not None
    best = best_start(
        lambda: mapped(database, images, len(photos), settings, known, work, log),
        photos, database, images, work, known, log,
    )  # fmt: skip
    if best is None:
        raise InputError(_why_none(photos, database, settings))
    model = best.model
    if best.loose:
        log(f"{best.loose} photos hang on hardly any point of the others: they are left out")
    angle = float(np.median(triangulation_angles(model))) if model.num_points3D() else 0.0
    if angle < MIN_ANGLE_DEG:
        raise InputError(why_small_angles(_source(settings), angle, walked(model)))
    with whole_folder(work / "model") as partial:
        model.write(partial)
    other = [sorted(names_of(one) - names_of(model)) for one in best.others]
    doubt = contradictions(model, database)._asdict()
    result = {"other_models": other, "angle_deg": angle, "contradictions": doubt, "focal": best.focal.as_dict()}
    return stages.finished("model", key, result)


def _pairs(
    photos: Sequence[ChosenPhoto], key: str, settings: PrepareConfig, stages: StageCache, database: Path, log: Log
) -> list[tuple[int, int]]:
    known = stages.found("pairs", key)
    if known is None:
        count = len(photos)
        if count <= settings.exhaustive:
            pairs = all_pairs(count)
        else:
            pairs = sequential_pairs(count, settings.overlap)
            if settings.loops:
                log(f"loop closure: which of {count} photos look alike")
                alike = similarity(count, lambda index: descriptors(database, index))
                pairs = sorted({*pairs, *loop_pairs(alike, settings.loops, settings.overlap)})
        with pycolmap.Database.open(database) as opened:  # what other settings matched does not count
            opened.clear_matches()
            opened.clear_two_view_geometries()
        known = stages.finished("pairs", key, {"pairs": pairs})
    return [(i, j) for i, j in known["pairs"]]


def _why_none(photos: Sequence[ChosenPhoto], database: Path, settings: PrepareConfig) -> str:
    """Why nothing could be reconstructed."""
    pairs = verified_pairs(database)
    good = [count for count, _ in pairs.values() if count >= MIN_MATCHES]
    source = _source(settings)
    if len(good) < len(photos) / 2:
        return (
            f"{source} has {len(photos)} photos of which hardly any two show the same ({len(good)} pairs); film "
            "slower, so that each photo shows most of the one before"
        )
    no_parallax = why_no_parallax(source, pairs)
    if no_parallax:
        return no_parallax
    return (
        f"{source} gives no reconstruction although {len(good)} pairs of photos match; film again, slowly, with "
        "steps to the side"
    )


def _source(settings: PrepareConfig) -> str:
    return str(settings.video or settings.images)


def _scene(out: Path, model: Path, config: Config) -> Scene:
    """The photos with their poses in the model's own unit."""
    read = read_model(model)
    capture = Capture(
        out, "colmap", model_shots(read, out / IMAGES, None), W2C_OPENCV, metric=False, why="", points=read.points
    )
    settings = replace(
        config.scene, frames=None, stride=1, image_width="full", intrinsics=None, pixel_centres="auto", poses="auto",
        unit="auto", test_every=0, gt_mesh=None,
    )  # fmt: skip
    return assembled(capture, settings)


def _room(scene: Scene, key: str, stages: StageCache, log: Log) -> RoomFrame:
    known = stages.found("room", key)
    if known is None:
        log("upright: looking for edges")
        frames = evenly_spaced(scene.train, TURNED_PHOTOS)
        progress = Progress(log, "upright", len(frames), "photos")

        def pictures():
            for count, frame in enumerate(frames):
                progress.at(count)
                yield frame.color()

        found = room_frame([frame.camera for frame in frames], pictures())
        known = stages.finished("room", key, found._asdict() | {"room_from_world": found.room_from_world.tolist()})
    return RoomFrame(np.array(known["room_from_world"]), known["vertical_edges"], known["walls"])


def _scale(
    scene: Scene,
    room: RoomFrame,
    photos: Sequence[ChosenPhoto],
    config: Config,
    key: str,
    stages: StageCache,
    log: Log,
) -> Scale | None:
    settings = config.prepare
    assert scene.given_points is not None  # of the model that was just made
    if settings.length is not None:
        centres = {frame.color_path.name: frame.camera.centre for frame in scene.train}
        seconds = {photo.name: photo.seconds for photo in photos if photo.seconds is not None}
        up = room.room_from_world.T
        height = height_over_floor(scene.given_points().xyz @ up, np.array(list(centres.values())) @ up)
        return scale_by_length(settings.length, centres, seconds, height)
    key = key_of(key, settings.depth)
    known = stages.found("scale", key)
    if known is None:
        points = scene.given_points()
        if settings.depth:
            files = depth_files(Path(settings.depth), photos)
            log(f"scale: by the sensor's depth of {len(files)} photos")
            found = scale_by_maps(scene.train, points, sensor_depths(files), "sensor", SENSOR_SIGMA, log)
            if found is None:
                raise InputError(
                    f"{settings.depth} has depth for too few of the placed photos' points; leave prepare.depth out, or "
                    "give prepare.length"
                )
        else:
            log("scale: by the depth network")
            found = scale_by_maps(scene.train, points, network_depths(settings.threads), "network", NETWORK_SIGMA, log)
        known = stages.finished("scale", key, {"scale": scale_dict(found)})
    return None if known["scale"] is None else Scale(**known["scale"])


def _written(
    out: Path,
    model: pycolmap.Reconstruction,
    photos: Sequence[ChosenPhoto],
    features: Sequence[int],
    found: dict[str, Any],
    room: RoomFrame,
    scale: Scale | None,
    settings: PrepareConfig,
    log: Log,
) -> dict[str, Any]:
    """The capture, upright and in metres, with the verdict last."""
    metres, focal = 1.0 if scale is None else scale.metres, focal_from_dict(found["focal"])
    model.transform(_room_from_model(model, room.room_from_world, metres))
    with whole_folder(out / SPARSE) as partial:
        (partial / "0").mkdir()
        model.write(partial / "0")
    if settings.depth:
        _copy_depths(out / DEPTH, depth_files(Path(settings.depth), photos))
    else:
        shutil.rmtree(out / DEPTH, ignore_errors=True)
    seen = {image.name: image.num_points3D for image in map(model.image, model.reg_image_ids())}
    placed = [photo for photo in photos if photo.name in seen]
    cameras = {image.name: image.cam_from_world() for image in map(model.image, model.reg_image_ids())}
    poses = [cameras[photo.name].inverse() for photo in placed]
    xyz = np.array([point.xyz for _, point in sorted(model.points3D.items())]).reshape(-1, 3)
    weak = [seen[photo.name] < FEW_POINTS for photo in placed]
    centres = np.array([pose.translation for pose in poses])
    forwards = np.array([pose.rotation.matrix()[:, 2] for pose in poses])
    draw_path(out / PICTURE, xyz, centres, forwards, weak, scale is not None)
    verdict = {
        "source": _source(settings),
        "photos": len(photos),
        "placed": len(placed),
        "left_out": [photo.name for photo in photos if photo.name not in seen],
        "other_models": found["other_models"],
        "points": model.num_points3D(),
        "track_length": model.compute_mean_track_length(),
        "reprojection_px": model.compute_mean_reprojection_error(),
        "angle_deg": found["angle_deg"],
        "contradictions": found["contradictions"],
        "warnings": [*doubts(found["contradictions"]), *_lens_and_way(model, focal, scale)],
        "focal_px": focal.px,
        "focal": focal.as_dict(),
        "metric": scale is not None,
        "scale": scale_dict(scale),
        "height_m": None if scale is None else height_over_floor(xyz, centres),
        "upright": upright_line(room),
        "film_again": weak_stretches(photos, seen, features),
    }
    lines = verdict_lines(verdict)
    with whole_file(out / VERDICT) as temporary:
        temporary.write_text(json.dumps(plain(verdict), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    for line in ["", *lines, f"capture: {out}", f"the cameras' path: {out / PICTURE}"]:
        log(line)
    return verdict


def _lens_and_way(model: pycolmap.Reconstruction, focal: Focal, scale: Scale | None) -> list[str]:
    """Warnings of what the photos do not determine."""
    cameras = list(model.cameras.values())
    size = max(((camera.width, camera.height) for camera in cameras), key=lambda size: size[0])
    found = [
        focal_doubt(focal, size, turn_deg(model)),
        None if walked(model) else hardly_walked(),
        scale_doubt(scale),
    ]
    return [one for one in found if one is not None]


def _room_from_model(model: pycolmap.Reconstruction, rotation: np.ndarray, metres: float) -> pycolmap.Sim3d:
    """Upright, in metres, about the middle of the cameras, z = 0 at the lowest points."""
    centres = np.array([model.image(image_id).projection_center() for image_id in sorted(model.reg_image_ids())])
    xyz = np.array([point.xyz for _, point in sorted(model.points3D.items())])
    origin = np.median(centres @ rotation.T, axis=0)
    origin[2] = np.quantile((xyz @ rotation.T)[:, 2], 0.01)
    return pycolmap.Sim3d(np.c_[metres * rotation, -metres * origin])


def _copy_depths(folder: Path, files: dict[str, Path]) -> None:
    with whole_folder(folder) as partial:
        for name, path in files.items():
            shutil.copyfile(path, partial / f"{Path(name).stem}{path.suffix}")
