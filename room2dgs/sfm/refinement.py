"""Pose refinement, used where it clearly lowers the reprojection errors of held-out tracks."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.point_cloud import Tracks
from room2dgs.captures.poses_file import read_poses, with_cameras, without, write_poses
from room2dgs.captures.scene import Scene
from room2dgs.captures.with_lens import with_focal, with_lens
from room2dgs.config import PointsConfig, SfmConfig
from room2dgs.errors import InputError
from room2dgs.files import remove_leftovers, scratch_folder
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.view_selection import seen_by_others, shared_view
from room2dgs.logs import Log
from room2dgs.sfm.adjust import adjusted
from room2dgs.sfm.bundle import moves
from room2dgs.sfm.capture_points import capture_points
from room2dgs.sfm.feature_tracks import FeatureTracks, feature_tracks, judges_and_used
from room2dgs.sfm.lens import LensFound, found_lens
from room2dgs.sfm.matching import IndexPairs, Matches, epipolar_inlier_share, match, of_photos
from room2dgs.sfm.pairs import match_pairs
from room2dgs.sfm.propagated import propagated
from room2dgs.sfm.resection import known_points, resected
from room2dgs.sfm.sparse import digest_of_views, keep_points
from room2dgs.sfm.structure import track_errors
from room2dgs.sfm.triangulation import MAX_EPIPOLAR_PX, triangulate_matches

# Raised when the same input gives other poses.
RECIPE = 9
LEAST_TRACKS = 100
# Of the training views, that have to have tracks enough for a pose: the others would stay where they were, and a room
# that is half moved is worse than one that is a little off as a whole.
LEAST_KNOWN = 1 / 3
# "auto" takes poses that lower the held-out error to this share of it and by this much
SHARE, LEAST_PX = 0.8, 0.05
PROMISING = 0.95  # after the first round; else there is no second one
# Views whose poses photos do not tell are left out if the given poses are off by more than this in the middle, and if
# so much of what they see others see, too: blank walls that nobody else sees are better a little off than not there.
HARMFUL_PX, SEEN_BY_OTHERS = 0.5, 0.9
# A camera that moved this many times as far as the middle one, and farther than this, is left where it was.
SAID_FOCAL = 0.003  # a change of the focal length that the log has
SAID_SCALE = 0.01  # a change of scale that was taken back; the log has it from here on
JUMP, JUMP_M, JUMP_DEG = 5.0, 0.03, 1.5


@dataclass(frozen=True)
class PoseReport:
    """Result of the refinement, for log and report.

    Attributes:
        refined: whether the refined poses are used.
        why: one sentence for the log.
        before_px, after_px: median reprojection error of held-out tracks, with the given and the adjusted poses.
        agree_before, agree_after: share of the matches within 2 px of their epipolar lines.
        moved_m, turned_deg: medians over the training views.
        scale_change: share by which the photos alone would have changed the scale; that of the given poses is held.
        left: names of views that could not be refined; they have propagated corrections or their given poses.
        left_out: those of them that are removed from the scene.
        lens: the distorted lens that was found, as `poses_file` reads it, with its errors.
        focal: by what all focal lengths were multiplied; None: they are as given.
    """

    refined: bool
    why: str
    before_px: float | None = None
    after_px: float | None = None
    agree_before: float | None = None
    agree_after: float | None = None
    moved_m: float | None = None
    turned_deg: float | None = None
    scale_change: float | None = None
    left: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    lens: dict[str, Any] | None = None
    focal: float | None = None


def refined_poses(
    scene: Scene,
    config: SfmConfig,
    points: PointsConfig,
    cache: Path,
    log: Log = print,
    extracted: Callable[[], None] = lambda: None,
    metres: bool = True,
) -> tuple[Scene, dict[str, Any]]:
    """The scene with poses that fit its photos, in the frame and scale of the given poses.

    Poses of training views come from training photos alone. Held-out views are then registered to the training views'
    points, one by one. The result is cached under a hash of photos, poses and settings, with the sparse points, so that
    photos are matched once.

    Args:
        config: `refine_poses` false: nothing is done; true: refined poses are used even if they gain little; auto:
            only if they gain clearly, and not if points are given by a file or by the capture with tracks.
            `leave_out`: removes views that could not be refined if the other views' poses were clearly wrong and other
            views see the same surfaces.
        log: takes one line at a time.
        extracted: called once the features are extracted; from then on a core is free (see `match`).
        metres: whether the scene's lengths are known to be metres; else the log has them in the capture's unit.

    Returns:
        The scene, and `PoseReport` as plain values.

    Raises:
        InputError: the photos match, but not where the poses say.
    """
    if config.refine_poses is False:
        return scene, asdict(PoseReport(False, "sfm.refine_poses=false"))
    if config.refine_poses == "auto" and _points_are_given(scene, points):
        return scene, asdict(PoseReport(False, "points are given"))
    path = cache / f"poses-{_key(scene, config, points)}.json"
    if path.exists():
        try:
            known, report = read_poses(path, scene)
        except InputError:  # damaged: made again
            path.unlink()
        else:
            for line in _lines(PoseReport(**report), metres):
                log(f"{line} ({path.name})")
            return known, report
    remove_leftovers(cache)
    with scratch_folder(cache, "sfm") as work:
        refined, found = _refined(scene, config, points, work, cache, log, extracted)
    for line in _lines(found, metres):
        log(line)
    if found.left_out:
        words = "views left out, whose photos do not tell their poses (sfm.leave_out=false keeps them)"
        log(f"{words}: {', '.join(found.left_out)}")
    kept = [name for name in found.left if name not in found.left_out]
    if found.refined and kept:
        log(f"views left at their given poses, or moved as those before and after: {', '.join(kept)}")
    report = json.loads(json.dumps(asdict(found)))
    write_poses(path, scene, refined, report)
    return refined, report


def _points_are_given(scene: Scene, config: PointsConfig) -> bool:
    """Whether points come from a file or from the capture, so that photos need no matching."""
    if config.source == "auto" and scene.given_points is not None:
        return capture_points(scene, config, lambda line: None) is not None
    return config.source == "file"


def _refined(
    scene: Scene,
    config: SfmConfig,
    settings: PointsConfig,
    work: Path,
    cache: Path,
    log: Log,
    extracted: Callable[[], None],
) -> tuple[Scene, PoseReport]:
    matches, pairs = _matched(scene, settings, work / "given", log, extracted)
    given = [frame.camera for frame in scene.train]
    joined = feature_tracks(matches, given, pairs)
    lens = found_lens(given, joined.tracks) if config.refine_lens and _may_be_distorted(scene) else None
    if lens is not None:
        scene = with_lens(scene, lens.lens)
        matches, pairs = _matched(scene, settings, work / "straight", log)
        given = [frame.camera for frame in scene.train]
        joined = feature_tracks(matches, given, pairs)
    forced = config.refine_poses is True
    cameras, found = judged(given, joined.tracks, matches, pairs, forced=forced, focal=config.refine_lens)
    if lens is not None:
        found = replace(found, lens=_as_report(lens))
    if found.focal is not None:
        scene = with_focal(scene, found.focal)
    refined = scene
    if found.refined:
        placed, left = _placed(scene, matches, joined, cameras, found)
        found = replace(found, left=(*found.left, *left))
        refined = with_cameras(scene, placed)
        moved, off = propagated_to_unplaced(scene, refined, found.left)
        refined = with_cameras(refined, moved)
        if config.leave_out:
            harmful = [name for name in found.left if (found.before_px or 0) * off[name] > HARMFUL_PX]
            found = replace(found, left_out=dispensable(refined, harmful))
            refined = without(refined, found.left_out)
            kept = [index for index, frame in enumerate(scene.train) if frame.name not in found.left_out]
            matches, pairs = of_photos(matches, pairs, kept)
    if settings.source != "file":
        cloud = triangulate_matches(matches, refined.train, pairs, settings, work / "model")
        keep_points(refined, settings, cache, cloud)
    return refined, found


def _matched(
    scene: Scene, settings: PointsConfig, work: Path, log: Log, extracted: Callable[[], None] = lambda: None
) -> tuple[Matches, IndexPairs]:
    """All photos matched, and the pairs of training photos among them."""
    given = [frame.camera for frame in scene.train]
    pairs = match_pairs(given, settings.overlap)
    log(f"poses: matching {len(pairs)} pairs of {len(given)} photos, and {len(scene.test)} held-out ones")
    others = _held_out_pairs(given, [frame.camera for frame in scene.test], settings.overlap)
    return match((*scene.train, *scene.test), [*pairs, *others], settings, work, extracted), pairs


def _may_be_distorted(scene: Scene) -> bool:
    """Whether all photos have one pinhole camera and no depth map that is registered to it."""
    first = scene.train[0].camera
    return all(
        frame.lens is None
        and frame.depth_path is None
        and frame.camera.size == first.size
        and np.array_equal(frame.camera.K, first.K)
        for frame in scene.frames
    )


def _as_report(found: LensFound) -> dict[str, Any]:
    lens = found.lens
    evidence = {name: getattr(found, name) for name in ("focal", "before_px", "after_px", "moved_px")}
    return {"model": lens.model, "params": list(lens.params), "size": list(lens.known_size), **evidence}


def propagated_to_unplaced(
    given: Scene, refined: Scene, left: Collection[str]
) -> tuple[dict[str, Camera], dict[str, float]]:
    """By name, the cameras of views that were not refined with corrections propagated from training views, and the
    expected share of each view's rotation error that remains."""
    training = {frame.name for frame in given.train}
    cameras: dict[str, Camera] = {}
    off: dict[str, float] = {}
    for names in (training, training.union(left)):  # training views first, who are to know nothing of held-out ones
        before, after = ([one for one in scene.frames if one.name in names] for scene in (given, refined))
        known = np.array([one.name in training and one.name not in left for one in after])
        found = propagated([one.camera for one in after], [one.camera for one in before], known)
        for frame, camera, share in zip(after, found.cameras, found.remaining, strict=True):
            if frame.name in left:
                cameras.setdefault(frame.name, camera)
                off.setdefault(frame.name, float(share))
    return cameras, off


def dispensable(scene: Scene, left: Collection[str]) -> tuple[str, ...]:
    """Those of the views that could not be refined whose surfaces refined training views see, too."""
    others = [frame.camera for frame in scene.train if frame.name not in left]
    cameras = {frame.name: frame.camera for frame in scene.frames}
    return tuple(name for name in left if seen_by_others(cameras[name], others) >= SEEN_BY_OTHERS)


def judged(
    given: Sequence[Camera], tracks: Tracks, matches: Matches, pairs: IndexPairs, forced: bool, focal: bool = False
) -> tuple[list[Camera], PoseReport]:
    """The adjusted poses if held-out tracks fit them better, else the given ones, and the reason.

    Cameras that moved much farther than the others keep their given poses.

    Args:
        forced: adjusted poses are taken if they gain anything.
        focal: the focal length is adjusted with the poses; the cameras then have it, too.
    """
    count = int(tracks.point.max()) + 1 if len(tracks) else 0
    if count < LEAST_TRACKS:
        return list(given), PoseReport(False, f"only {count} tracks through 3 photos or more")
    judges, used = judges_and_used(tracks)
    before = float(np.median(track_errors(given, judges)))
    cameras, known, scale_change = adjusted(given, used, rounds=1)
    if not known.any():
        return list(given), PoseReport(False, "no group of photos has tracks enough")
    if forced or float(np.median(track_errors(cameras, judges))) <= PROMISING * before:
        cameras, known, more = adjusted(given, used, start=cameras, focal=focal)
        scale_change = (1 + scale_change) * (1 + more) - 1
    if known.mean() < LEAST_KNOWN and not forced:
        enough = int(np.count_nonzero(known))
        return list(given), PoseReport(False, f"only {enough} of {len(given)} photos have tracks enough")
    metres, degrees = moves(cameras, given)
    jumped = metres > max(JUMP_M, JUMP * float(np.median(metres[known])))
    jumped |= degrees > max(JUMP_DEG, JUMP * float(np.median(degrees[known])))
    left = jumped | ~known
    cameras = [
        replace(new, cam_from_world=old.cam_from_world) if unplaced else new
        for new, old, unplaced in zip(cameras, given, left, strict=True)
    ]
    factor = float(cameras[0].K[0, 0] / given[0].K[0, 0])
    after = float(np.median(track_errors(cameras, judges)))
    agree_before, agree_after = (
        epipolar_inlier_share(matches, one, pairs, MAX_EPIPOLAR_PX) for one in (given, cameras)
    )
    figures: dict[str, Any] = {
        "before_px": before if np.isfinite(before) else None,
        "after_px": after if np.isfinite(after) else None,
        "agree_before": agree_before,
        "agree_after": agree_after,
        "moved_m": float(np.median(metres[known])),
        "turned_deg": float(np.median(degrees[known])),
        "scale_change": scale_change,
        "left": tuple(name for name, unplaced in zip(tracks.frames, left, strict=True) if unplaced),
    }
    clearly = after <= SHARE * before and before - after >= LEAST_PX and agree_after >= agree_before
    if clearly or (forced and after < before):
        figures["focal"] = factor if factor != 1 else None
        return cameras, PoseReport(True, "they fit the photos better", **figures)
    return list(given), PoseReport(False, "they fit the photos", **figures)


def _placed(
    scene: Scene, matches: Matches, joined: FeatureTracks, cameras: Sequence[Camera], found: PoseReport
) -> tuple[dict[str, Camera], list[str]]:
    """Cameras of all frames by name, and the held-out views that kept their poses."""
    placed = {frame.name: camera for frame, camera in zip(scene.train, cameras, strict=True)}
    xyz = known_points(joined, cameras)
    left = []
    for photo, frame in enumerate(scene.test, start=len(cameras)):
        camera = resected(photo, frame.camera, matches, joined, xyz, cameras, max(found.moved_m or 0, 0.001))
        if camera is not None:
            (metres,), (degrees,) = moves([camera], [frame.camera])
            usual_m, usual_deg = found.moved_m or 0.0, found.turned_deg or 0.0
            far = metres > max(JUMP_M, JUMP * usual_m) or degrees > max(JUMP_DEG, JUMP * usual_deg)
            if not far:
                placed[frame.name] = camera
                continue
        left.append(frame.name)
    return placed, left


def _held_out_pairs(given: Sequence[Camera], others: Sequence[Camera], overlap: int) -> list[tuple[int, int]]:
    """(training view, held-out view): for each of the latter the training views that share most with it."""
    if not others:
        return []
    count = len(given)
    score = shared_view([*given, *others])[count:, :count]
    best = np.argsort(-score, axis=1, kind="stable")[:, :overlap]
    return [(int(i), count + j) for j in range(len(others)) for i in sorted(best[j]) if score[j, i] > 0]


def _lines(found: PoseReport, metres: bool = True) -> list[str]:
    """For the log; lengths in cm, or in the capture's unit."""
    lines = []
    if found.lens:
        focal = " and ".join(f"{value:.4f}" for value in found.lens["focal"])
        lines.append(
            f"lens: focal lengths {focal} times the given ones, and distortion; reprojection error "
            f"{found.lens['before_px']:.2f} -> {found.lens['after_px']:.2f} px: photos are straightened "
            "(sfm.refine_lens=false leaves them as they are)"
        )
    if found.before_px is None or found.after_px is None:
        return [*lines, f"poses kept: {found.why}"]
    if not found.refined:
        return [*lines, f"poses kept: reprojection error {found.before_px:.2f} px, {found.after_px:.2f} px if refined"]
    assert found.moved_m is not None
    moved = f"{100 * found.moved_m:.1f} cm" if metres else f"{found.moved_m:.2g} of the capture's unit"
    lines.append(
        f"poses refined: reprojection error {found.before_px:.2f} -> {found.after_px:.2f} px, "
        f"{found.agree_before:.0%} -> {found.agree_after:.0%} of the matches agree, cameras moved "
        f"{moved}, {found.turned_deg:.2f} deg (median)"
    )
    if found.focal is not None and abs(found.focal - 1) >= SAID_FOCAL:
        lines.append(
            f"poses: the photos want focal lengths {found.focal:.4f} times the given ones, and get them "
            "(sfm.refine_lens=false keeps the given ones)"
        )
    if found.scale_change is not None and abs(found.scale_change) >= SAID_SCALE:
        lines.append(
            f"poses: by the photos alone the room would be {abs(found.scale_change):.1%} "
            f"{'larger' if found.scale_change > 0 else 'smaller'}; the scale of the given poses is held"
        )
    return lines


def _key(scene: Scene, config: SfmConfig, points: PointsConfig) -> str:
    settings = [RECIPE, str(config.refine_poses), config.leave_out, config.refine_lens, points.source]
    return digest_of_views((*scene.train, None, *scene.test), points, settings)
