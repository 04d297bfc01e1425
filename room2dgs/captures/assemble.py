"""From a reader's `Capture` to a `Scene`: frames are chosen, poses and intrinsics converted to OpenCV's conventions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Lost, Shot, file_name, pose_in_world, world_from_cam
from room2dgs.captures.capture_points import CapturePoints
from room2dgs.captures.entry import Entry
from room2dgs.captures.exif import focal_doubt
from room2dgs.captures.fitted import fitted
from room2dgs.captures.held_out import held_out
from room2dgs.captures.keyframes import keyframes
from room2dgs.captures.left_out import MOST_MISSING, left_out, missing_photos
from room2dgs.captures.lens import pinhole_of
from room2dgs.captures.links import links_out
from room2dgs.captures.mask_images import Masks
from room2dgs.captures.matrix_files import rigid
from room2dgs.captures.photo_names import shared_stems
from room2dgs.captures.reach import near_each_other
from room2dgs.captures.scene import Dropped, Frame, Scene
from room2dgs.captures.selection import evenly_spaced, hold_out
from room2dgs.captures.working_size import ImageWidth, resized_camera, size_note
from room2dgs.captures.world_offset import AT_ORIGIN, in_scene, offset_note, origin_beside, rounded_centres
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose
from room2dgs.regular_files import check_regular

MIN_VIEWS = 3


def assembled(capture: Capture, config: SceneConfig) -> Scene:
    """A scene of some of the capture's photos.

    Taken is every `stride`-th, of these the ones with a pose, of these `frames` evenly spaced; then the capture's own
    test photos are held out, or every `test_every`-th.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    root = capture.root
    entries, dropped, messages = _posed(capture, config)
    posed = len(entries)
    entries = evenly_spaced(entries, config.frames)
    not_chosen = posed - len(entries)
    _check_enough(entries, dropped, root)
    entries, elsewhere, alone = near_each_other(entries, capture, config)
    dropped += elsewhere
    _check_enough(entries, dropped, root)
    # of the first: other frames of the same capture do not move it
    origin_m = origin_beside(entries[0].world_from_cam[:3, 3])
    rounded = rounded_centres([one.world_from_cam for one in entries], origin_m)
    if origin_m != AT_ORIGIN:
        entries = [replace(one, world_from_cam=in_scene(one.world_from_cam, origin_m)) for one in entries]
    entries, unreadable, notes, doubts = fitted(capture, entries, config)
    dropped += unreadable
    _check_enough(entries, dropped, root)
    wide = any(entry.size[0] >= entry.size[1] for entry in entries)
    poses = capture.poses if config.poses == "auto" else config.poses
    masks = Masks([entry.mask for entry in entries if entry.mask is not None])
    frames = [replace(_frame(entry, config.image_width, wide), poses=poses, masks=masks) for entry in entries]
    shared = shared_stems(shot.path for shot in capture.shots)
    frames = [replace(frame, shares_stem=frame.color_path.stem in shared) for frame in frames]
    _check_names(frames)
    train, test, of_split = _split(frames, capture, config)
    chosen = set(keyframes([frame.camera for frame in train], config.keyframes))
    doubt = focal_doubt([(entry.shot, entry.fitted_lens) for entry in entries])
    points = None
    if capture.points is not None:
        shots = {frame.name: entry.shot.name for frame, entry in zip(frames, entries, strict=True)}
        points = CapturePoints(capture, tuple(train), shots, config.given_unit, origin_m)
    return Scene(
        root,
        tuple(train),
        tuple(test),
        tuple(dropped),
        _gt_mesh(capture, config),
        layout=capture.layout,
        metric=capture.metric,
        notes=(*capture.notes, *_notes(capture, config, entries), *notes, *offset_note(origin_m)),
        warnings=(*capture.warnings, *messages, *of_split, *doubts, *alone, *rounded, *([doubt] if doubt else [])),
        given_points=points,
        matched_only=frozenset(frame.name for index, frame in enumerate(train) if index not in chosen),
        origin_m=origin_m,
        not_chosen=not_chosen,
    )


def _check_enough(entries: Sequence[Entry], dropped: Sequence[Dropped], root: Path) -> None:
    if len(entries) < MIN_VIEWS:
        lost = f" ({len(dropped)} dropped: {dropped[0].reason})" if dropped else ""
        raise InputError(
            f"{root} has {len(entries)} usable views{lost}, at least {MIN_VIEWS} are needed; "
            "add frames or lower scene.stride"
        )


def _posed(capture: Capture, config: SceneConfig) -> tuple[list[Entry], list[Dropped], list[str]]:
    """Shots with their poses, those that are left out, and warnings of the ones that ought to be there."""
    entries, dropped, damaged = [], [], {}
    poses = capture.poses if config.poses == "auto" else config.poses
    chosen = list(enumerate(capture.shots))[:: config.stride]
    missing = missing_photos([shot for _, shot in chosen])
    warned = [left_out(missing, len(chosen), "photos that are missing", MOST_MISSING)]
    for index, shot in chosen:
        if shot.name in missing:
            dropped.append(Dropped(file_name(shot.name), missing[shot.name]))
            continue
        try:
            pose = world_from_cam(_disk_pose(shot), poses)
        except (Lost, InputError) as reason:
            dropped.append(Dropped(file_name(shot.name), str(reason)))
            if isinstance(reason, InputError):
                damaged[shot.name] = str(reason)
            continue
        if capture.world_from_disk is not None:
            pose = pose_in_world(pose, capture.world_from_disk)
        if config.given_unit is not None:
            pose = pose.copy()
            pose[:3, 3] *= config.given_unit
        entries.append(Entry(index, shot, pose))
    warned.append(left_out(damaged, len(chosen), "poses that cannot be used"))
    return entries, dropped, [one for one in warned if one is not None]


def _disk_pose(shot: Shot) -> np.ndarray:
    if callable(shot.pose):
        return shot.pose()
    if shot.pose is None:
        raise Lost("it has no pose")
    if not np.isfinite(shot.pose).all():
        raise Lost("its pose holds inf or NaN (tracking lost)")
    return rigid(np.asarray(shot.pose, np.float64), f"the pose of {shot.path}")


def _frame(entry: Entry, image_width: ImageWidth, wide: bool) -> Frame:
    lens, depth, shot = entry.fitted_lens, entry.shot.depth, entry.shot
    pinhole = pinhole_of(lens) if lens.distorts else None
    K, size = (lens.K, lens.known_size) if pinhole is None else (pinhole.K, pinhole.size)
    camera = resized_camera(Camera(K, *size, inverse_pose(entry.world_from_cam)), image_width, wide)
    return Frame(
        file_name(shot.name),
        camera,
        shot.path,
        depth if isinstance(depth, Path) else (None if depth is None else Path(depth.label)),
        index=entry.index,
        photo=entry.photo,
        lens=None if pinhole is None else lens,
        mask_photo=entry.mask,
        transparent=entry.transparent,
        depth_map=None if isinstance(depth, Path) else depth,
    )


def _check_names(frames: Sequence[Frame]) -> None:
    seen: dict[str, Frame] = {}
    for frame in frames:
        other = seen.setdefault(frame.name.casefold(), frame)
        if other is not frame:
            raise InputError(
                f"{other.color_path} and {frame.color_path} would both be called {other.name} (names count without "
                "their ending, with _ for / and in any case); rename one of them"
            )


def _split(frames: list[Frame], capture: Capture, config: SceneConfig) -> tuple[list[Frame], list[Frame], list[str]]:
    """Training views, held-out ones, and warnings of the capture's own split."""
    names, messages = held_out(capture) if config.split == "capture" else (None, [])
    if names is not None:
        train = [frame for frame in frames if frame.name not in names]
        test = [frame for frame in frames if frame.name in names]
        if len(train) < MIN_VIEWS:
            raise InputError(
                f"{capture.root} holds out {len(test)} of the {len(frames)} views itself, {len(train)} are left for "
                f"training and at least {MIN_VIEWS} are needed; give scene.split=every"
            )
        return train, test, messages
    train, test = hold_out(frames, config.test_every)
    if len(train) < MIN_VIEWS:
        raise InputError(
            f"scene.test_every={config.test_every} leaves {len(train)} of the {len(frames)} views in {capture.root} "
            f"for training, at least {MIN_VIEWS} are needed; raise it, or set it to 0 to hold nothing out"
        )
    return train, test, messages


def _gt_mesh(capture: Capture, config: SceneConfig) -> Path | None:
    if not config.gt_mesh:
        return capture.gt_mesh
    path = Path(config.gt_mesh)
    check_regular(path, "give scene.gt_mesh the path of the ground-truth mesh")
    return path


def _notes(capture: Capture, config: SceneConfig, entries: list[Entry]) -> list[str]:
    """What a person should know of how the capture was understood."""
    count = len(entries)
    found = [f"layout: {capture.layout}, {capture.root}"]
    if config.given_unit is not None:
        found.append(f"scale: scene.unit={config.given_unit:g} metres")
    elif capture.metric:
        found.append(f"scale: metres ({capture.why})")
    else:
        found.append(f"scale: unknown ({capture.why}); give scene.unit=METRES of one unit if you know it")
    models = [entry.fitted_lens.model for entry in entries if entry.fitted_lens.distorts]
    if models:
        found.append(f"undistorted on reading: {len(models)} of {count} photos ({models[0]})")
    masks = sum(entry.shot.mask is not None for entry in entries)
    if masks:
        found.append(f"masks: {masks} of {count} photos; what they hide is not used")
    depths = sum(entry.shot.depth is not None for entry in entries)
    if depths:
        found.append(f"sensor depth: {depths} of {count} photos")
    found += size_note([entry.size for entry in entries], config.image_width)
    links = links_out(capture, [entry.shot for entry in entries])
    return found if links is None else [*found, links]
