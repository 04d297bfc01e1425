"""The sparse points of a scene: the capture's own, triangulated once and cached, or from a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.in_metres import scaled_points
from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.point_files import load_points, read_ply, save_points
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.world_offset import points_in_scene
from room2dgs.colmap import pycolmap
from room2dgs.config import PointsConfig
from room2dgs.errors import InputError
from room2dgs.files import remove_leftovers, scratch_folder
from room2dgs.logs import Log
from room2dgs.sfm.capture_points import MIN_POINTS, capture_points
from room2dgs.sfm.one_place import WALK, in_one_place, reach

# Raised when triangulation, pairs or the cache give something else for the same input. 2: with tracks; 3: on one
# thread, where pycolmap gives the same bits each time.
RECIPE = 3
NEXT = 2  # photos after each that it is compared with where there is no parallax


class MayLack(Enum):
    """Whether too few points are only a warning; photos that contradict their poses always stop a run."""

    NEVER = "never"
    IN_ONE_PLACE = "in one place"  # where no photo could tell a depth: that there is none is the answer
    WITH_METRES = "with metres"  # depth in metres comes from elsewhere


def sparse_points(
    scene: Scene,
    config: PointsConfig,
    cache: Path,
    log: Log = print,
    may_lack: MayLack = MayLack.NEVER,
    instead: str = "prior=room_prior",
) -> PointCloud:
    """The scene's sparse points.

    `source=auto` takes the capture's own where it brings enough with tracks, and otherwise does as `sfm`.
    `source=sfm` triangulates them from the training views alone, so that nothing of a held-out view is
    used; the result is kept in `cache` under a hash of photos, poses, intrinsics and settings, and a second
    call with the same ones loads it. `source=file` reads `config.file`.

    Args:
        cache: folder for the result, made if needed.
        log: takes one line at a time.
        may_lack: whether too few points are only a warning.
        instead: settings that take a network's depth where there are no points, for the message.

    Returns:
        At least `MIN_POINTS`; metres, world frame; none at all if they `may_lack` and photos give fewer.

    Raises:
        InputError: too few points, photos that disagree with their poses, or an unusable file.
    """
    if config.source == "file":
        points = points_in_scene(partial(_file_in_metres, Path(config.file or ""), scene.unit_m), scene.origin_m)
        if len(points) < MIN_POINTS:
            raise InputError(
                f"{config.file} holds {len(points)} points, at least {MIN_POINTS} are needed; give another file"
            )
        log(f"points: {len(points)} from {config.file}")
        return points
    if config.source == "auto" and scene.given_points is not None:
        given = capture_points(scene, config, log)
        if given is not None:
            return given
    path = _path(scene, config, cache)
    kept = load_points(path)
    if kept is not None:
        log(f"points: {len(kept)} from {path.name}")
        return kept
    from room2dgs.sfm.triangulation import triangulate

    remove_leftovers(cache)
    with scratch_folder(cache, "sfm") as work:
        points = triangulate(scene.train, config, work, log)
        if len(points) < MIN_POINTS:
            if may_lack is MayLack.NEVER or (may_lack is MayLack.IN_ONE_PLACE and not in_one_place(scene)):
                raise InputError(_too_few(scene, len(points), instead))
            (work / "again").mkdir()
            _stop_if_contradicted(scene, config, work / "again")
            log(f"WARNING: {_too_few_to_use(scene, len(points), may_lack)}")
            return _no_points(scene)
    log(f"points: {len(points)} triangulated, seen by {points.track_length.mean():.1f} views on average")
    keep_points(scene, config, cache, points)
    return points


def _file_in_metres(path: Path, unit_m: float | None) -> PointCloud:
    points = read_ply(path)
    return points if unit_m is None else scaled_points(points, unit_m)


def _too_few(scene: Scene, count: int, instead: str) -> str:
    elsewhere = f"give points.source=file points.file=PATH, or {instead} for the network's depth"
    if in_one_place(scene):
        return f"{_why(scene, count)}, so photos tell no depth; {WALK}, {elsewhere}"
    return (
        f"{_why(scene, count)}, at least {MIN_POINTS} are needed; add sharp overlapping photos, lower "
        f"points.min_track, {elsewhere}"
    )


def _too_few_to_use(scene: Scene, count: int, may_lack: MayLack) -> str:
    if may_lack is MayLack.IN_ONE_PLACE:
        return (
            f"{_why(scene, count)}, so photos tell no depth and stereo finds next to none; {WALK}, or take a network's "
            "depth: fill=true prior=room_prior"
        )
    advice = f"{WALK}, with photos that overlap" if in_one_place(scene) else "give sharp photos that overlap"
    why = f"{_why(scene, count)}, so photos tell no depth"
    return f"{why}: depth and the scale of the room are the prior's alone; {advice}"


def _why(scene: Scene, count: int) -> str:
    if in_one_place(scene):
        apart = f"{100 * reach(scene):.1f} cm" if scene.metric else f"{reach(scene):.3g} units"
        return f"{scene.path} was taken from one place (its cameras are at most {apart} apart)"
    return f"{scene.path} gives {count} points from {len(scene.train)} photos"


def _stop_if_contradicted(scene: Scene, config: PointsConfig, work: Path) -> None:
    """Photos without parallax still say how the cameras turned.

    Raises:
        InputError: otherwise than the poses say.
    """
    from room2dgs.sfm.contradiction import verdict
    from room2dgs.sfm.matching import match

    cameras = [frame.camera for frame in scene.train]
    pairs = [(i, j) for i in range(len(cameras)) for j in range(i + 1, min(i + 1 + NEXT, len(cameras)))]
    judged = verdict(match(scene.train, pairs, config, work), cameras, pairs)
    if judged.contradicted:
        raise InputError(
            f"{scene.path} has poses that its photos contradict: of {judged.matches} matches that fit each other "
            f"{judged.inlier_share:.0%} agree with them; write poses as camera-to-world with x right, y down, z "
            "forward, and check that they belong to these photos"
        )


def _no_points(scene: Scene) -> PointCloud:
    none = np.zeros(0, np.int32)
    tracks = Tracks(tuple(frame.name for frame in scene.train), none, none, np.zeros((0, 2), np.float32))
    return PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), tracks)


def keep_points(scene: Scene, config: PointsConfig, cache: Path, points: PointCloud) -> None:
    """Points that were triangulated with the scene's poses: the next `sparse_points` loads them."""
    if len(points) >= MIN_POINTS:
        save_points(_path(scene, config, cache), points)


def digest_of_views(frames: Sequence[Frame | None], config: PointsConfig, others: list[Any]) -> str:
    """Hash of photos, cameras, settings of the points, and others; None separates kinds of frames."""
    settings = {name: value for name, value in vars(config).items() if name not in ("source", "file", "cache")}
    digest = hashlib.sha256(json.dumps([*others, pycolmap.__version__, settings], sort_keys=True).encode())
    for frame in frames:
        if frame is None:
            digest.update(b"|")
            continue
        camera = frame.camera
        digest.update(f"{frame.name} {camera.width}x{camera.height}".encode())
        digest.update(camera.K.tobytes() + camera.cam_from_world.tobytes())
        digest.update(frame.digest())
    return digest.hexdigest()[:16]


def _path(scene: Scene, config: PointsConfig, cache: Path) -> Path:
    return cache / f"points-{digest_of_views(scene.train, config, [RECIPE])}.safetensors"
