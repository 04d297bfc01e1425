"""Completion of all views, and what they say of each other afterwards."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from itertools import islice

import cv2
import numpy as np

from room2dgs import _C
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.captures.uncertainty import completed_weight
from room2dgs.depth.completion.corrected import corrected
from room2dgs.depth.completion.correction import Correct
from room2dgs.depth.completion.creases import SeenPlanes
from room2dgs.depth.completion.evidence import CONSISTENCY_VIEWS
from room2dgs.depth.completion.expected_error import LEAST_ERROR
from room2dgs.depth.completion.expecting import expecting
from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.on_planes import flattened, on_planes
from room2dgs.depth.completion.other_views import LENDING, SureView, depth_of_other_views
from room2dgs.depth.completion.places import placed
from room2dgs.depth.completion.planes import Plane, Samples, find_planes
from room2dgs.depth.completion.reconciled import on_their_planes, with_neighbours
from room2dgs.depth.completion.small_maps import Completed, SmallMaps, enlarged, moved, small_maps
from room2dgs.depth.completion.solve import System, solved, system
from room2dgs.depth.files import resize_depth
from room2dgs.freed_memory import give_back
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.parallel_map import parallel_map
from room2dgs.geometry.view_selection import neighbours_by_points
from room2dgs.torch_threads import one_torch_thread

AT_ONCE = 16  # images, whose systems are in memory
ROUNDS = 2  # planes are found in the completed depth, which then bends to them and to what other views have
CORRECTED = 0.5  # of the distance at which a sample starts to count as off a plane, for corrected depth
LEAST_SEEN = 0.2  # trust that a pixel shows a plane, for the plane's creases
LEAST_SURE = 0.3  # confidence of a pixel that takes part in finding planes
FINE = 4.0  # expected errors by which stereo's own pixel differs if half of the difference counts as noise
LEAST_STEREO = 3  # views that must agree with a pixel of stereo for it to stand in its own right
NEAR = 0.03  # relative difference up to which it is the same surface


@one_torch_thread()  # here and not in each of the threads below, which would put back what others have set
def complete_views(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    confidences: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    normal_confidences: Mapping[str, np.ndarray],
    points: PointCloud,
    stereo: Mapping[str, tuple[np.ndarray, np.ndarray]],
    misfits: Mapping[str, float],
    log: Log,
    take: Callable[[str, np.ndarray, np.ndarray], None],
    *,
    planes: bool,
    right_angles: bool,
    creases: bool,
    other_views: bool,
    space: FreeSpace | None,
    correct: Correct | None = None,
) -> list[Plane]:
    """Depth of every view that has a map, and the confidence in each pixel.

    Args:
        frames: training views; those without a map in `depths` are passed over.
        depths: frame name -> (H, W) float32 metres, after the joint optimisation; 0 = invalid.
        confidences: frame name -> (H, W) what the network expects of its depth; 1 for the others.
        normals, normal_confidences: frame name -> (H, W, 3) unit, world frame, and (H, W).
        points: sparse points and stereo's (`with_depth_samples`).
        stereo: frame name -> depth and the number of consistent views of stereo, of any size; may be empty.
        misfits: frame name -> median relative residual of the prior at the points before any optimisation, NaN =
            unknown: where the network does badly, by the median over the views, its maps bend to the points.
        take: gets each frame's name, its (H, W) depth in metres, 0 = invalid, and (H, W) confidence.
        planes: what looks as if it lay on one of the room's large planes is drawn to it.
        right_angles: and those that are almost parallel or at right angles are so.
        creases: and they meet where the photos see them meet.
        other_views: depth is drawn to what is sure in other views.
        space: depth that other views look through counts for less; None = not asked.
        correct: corrects what comes of all this; None = nothing does.

    Returns:
        The planes that depth was drawn to.
    """
    frames = [frame for frame in frames if frame.name in depths]
    found: list[Plane] = []
    known = [one for one in (misfits.get(frame.name, np.nan) for frame in frames) if np.isfinite(one)]
    misfit = float(np.median(known)) if known else 0.0  # of a single view it says little where the view has few points

    def made_small(frame: Frame) -> SmallMaps:
        name = frame.name
        maps = (depths[name], confidences.get(name), normals.get(name), normal_confidences.get(name))
        return small_maps(frame, *maps, points, misfit)

    with ThreadPoolExecutor(_C.threads()) as pool:
        # maps are read where they are made small: all of them at full size would be most of a run's memory
        given = list(pool.map(made_small, frames))
        small = alone = _completed(given, pool)
        near = _near_views(frames, points)
        planes = planes and len(normals) > 0

        def planes_in(parts: Sequence[Completed], errors: Sequence[np.ndarray], width: float = 1.0) -> list[Plane]:
            if not planes:
                return []
            flat = find_planes(_samples(given, parts, errors, space), right_angles=right_angles, width=width)
            if creases:
                flat = placed(flat, list(pool.map(partial(_seen_planes, planes=flat), given, parts)))
            return flat

        for _ in range(ROUNDS if planes or other_views else 0):
            errors = list(pool.map(expecting(small, alone, near, space), range(len(frames))))
            found = planes_in(small, errors)
            held = list(pool.map(partial(_held_by_planes, planes=found, space=space), given, small))
            drawn = _held_by_other_views(held, small, errors, near) if other_views else None
            alone = _completed(held, pool)  # what views have told each other is no evidence
            small = _completed(drawn, pool) if drawn else alone
        flat = partial(_flat, planes=found)
        small, alone = list(pool.map(flat, given, small)), list(pool.map(flat, given, alone))
        expected = expecting(small, alone, near, space)
        if correct:
            corrects = [partial(correct, frame.name) for frame in frames]
            small, errors = corrected(given, small, alone, near, space, found, corrects)
            if other_views:
                small, errors = with_neighbours(small, errors, near)
            found = planes_in(small, errors, CORRECTED)
            small = on_their_planes(given, small, errors, found)
            expected = errors.__getitem__

    def whole(index: int) -> tuple[float, np.ndarray, np.ndarray]:
        frame, part, error = frames[index], small[index], expected(index)
        median = float(np.median(error[part.depth > 0])) if (part.depth > 0).any() else float("nan")
        depth = depths[frame.name]
        large = partial(cv2.resize, dsize=depth.shape[::-1], interpolation=cv2.INTER_LINEAR)
        sure = large(completed_weight(error))
        full = (depth * np.exp(enlarged(part.log_scale, part.depth > 0, depth.shape))).astype(np.float32)
        if frame.name in stereo:
            full = _with_fine(full, large(error.astype(np.float32)), *stereo[frame.name], frame.camera)
        return median, full, np.where(full > 0, sure, 0).astype(np.float32)

    medians = []
    for frame, (median, *maps) in zip(frames, parallel_map(whole, range(len(frames)), _C.threads()), strict=True):
        medians.append(median)
        take(frame.name, *maps)
    if frames:
        on = f"; planes: {len(found)}, with {sum(one.share for one in found):.0%} of the surface" if found else ""
        log(f"completion: depth of {len(frames)} views, expected error {np.nanmedian(medians):.1%} (median){on}")
    return found


def _seen_planes(maps: SmallMaps, part: Completed, planes: Sequence[Plane]) -> SeenPlanes:
    _, trust, which = on_planes(part.depth, maps.normal, maps.camera, planes)
    grey = cv2.cvtColor(maps.photo, cv2.COLOR_RGB2GRAY)
    return SeenPlanes(part.camera, grey, np.where(trust < LEAST_SEEN, -1, which), maps.anchor, maps.trust)


def _near_views(frames: Sequence[Frame], points: PointCloud) -> list[list[int]]:
    tracked = points if points.tracks is None else points.chosen(points.track_length > 1)
    seen = [seen_points(tracked, frame).index for frame in frames]
    return neighbours_by_points([frame.camera for frame in frames], seen, tracked.xyz, max(CONSISTENCY_VIEWS, LENDING))


def _samples(
    given: Sequence[SmallMaps], small: Sequence[Completed], errors: Sequence[np.ndarray], space: FreeSpace | None
) -> Samples:
    """Every other pixel of every other row of the views whose normals are known, where the depth is trusted."""
    parts = []
    for maps, part, error in zip(given, small, errors, strict=True):
        row, column = (one.ravel() for one in np.mgrid[1 : part.depth.shape[0] : 2, 1 : part.depth.shape[1] : 2])
        depth, normal, sure = part.depth[row, column], maps.normal[row, column], completed_weight(error[row, column])
        use = (depth > 0) & (sure > LEAST_SURE) & normal.any(axis=1)
        pixel = np.stack([column, row], axis=1)[use] + 0.5
        xyz = part.camera.unproject(pixel, depth[use])
        weight = sure[use] * depth[use] ** 2 * (1 - seen_through(space, xyz)) ** 2
        off = error[row, column][use] * depth[use]
        parts.append(Samples(xyz, normal[use], depth[use], weight, off))
    return Samples(*(np.concatenate(one) for one in zip(*parts, strict=True)))


def _held_by_planes(maps: SmallMaps, before: Completed, planes: Sequence[Plane], space: FreeSpace | None) -> SmallMaps:
    """What to complete once more: a plane is an anchor wherever it is trusted more than stereo, and where other views
    see through what was found, the prior has no say."""
    through = seen_through(space, maps.camera.unproject_map(before.depth))
    maps = maps._replace(prior_weight=(maps.prior_weight * (1 - through) ** 2).astype(np.float32))
    return _anchored(maps, *on_planes(before.depth, maps.normal, maps.camera, planes)[:2])


def _held_by_other_views(
    held: Sequence[SmallMaps], before: Sequence[Completed], errors: Sequence[np.ndarray], near: Sequence[Sequence[int]]
) -> Iterator[SmallMaps]:
    """Likewise what is sure in a view's neighbours; each made when it is asked for."""
    sure = [
        SureView(part.camera, part.depth, completed_weight(error)) for part, error in zip(before, errors, strict=True)
    ]
    return (_anchored(maps, *seen) for maps, seen in zip(held, depth_of_other_views(sure, near), strict=True))


def _anchored(maps: SmallMaps, depth: np.ndarray, trust: np.ndarray) -> SmallMaps:
    """With these anchors wherever they are trusted more than what there is."""
    use = trust > maps.trust
    anchor, trust = np.where(use, depth, maps.anchor), np.where(use, trust, maps.trust)
    return maps._replace(anchor=anchor.astype(np.float32), trust=trust.astype(np.float32))


def _completed(given: Iterable[SmallMaps], pool: Executor) -> list[Completed]:
    found, rest = [], iter(given)
    while some := list(islice(rest, AT_ONCE)):
        scales = solved(list(pool.map(_system, some)))
        found += [_at_scale(maps, scale.astype(np.float32)) for maps, scale in zip(some, scales, strict=True)]
    give_back()  # the systems of some images, again and again, between what stays
    return found


def _system(maps: SmallMaps) -> System:
    anchor, trust, prior, weight, slopes, tie, edges = maps[3:]
    double = partial(np.asarray, dtype=np.float64)
    given = (*map(double, (anchor, trust, prior, weight)), tuple(map(double, slopes)), double(tie), edges)
    return system(*given, by_normals=bool(maps.normal.any()))


def _at_scale(maps: SmallMaps, scale: np.ndarray) -> Completed:
    depth = (maps.prior * np.exp(scale)).astype(np.float32)
    return Completed(maps.camera, maps.anchor, maps.trust, scale, depth, np.zeros_like(depth))


def _flat(maps: SmallMaps, before: Completed, planes: Sequence[Plane]) -> Completed:
    """What almost lies on a plane lies on it."""
    shift, share = flattened(before.depth, maps.normal, maps.camera, planes)
    return moved(before, shift)._replace(flat=share.astype(np.float32))


def _with_fine(
    depth: np.ndarray, error: np.ndarray, stereo: np.ndarray, num_consistent: np.ndarray, camera: Camera
) -> np.ndarray:
    """Stereo's own pixels where they hardly differ, for how sure depth is: they have the fine detail. What differs by
    more is noise, or what completion has mended.

    Args:
        error: (H, W) expected relative error of the depth.
    """
    kept = np.where(num_consistent >= LEAST_STEREO, stereo, 0)
    fine, there = resize_depth(kept, kept > 0, camera)
    there &= np.abs(fine - depth) < NEAR * depth
    detail = np.log(np.where(there, fine, 1) / np.where(there, depth, 1))
    noise = FINE * np.maximum(error, LEAST_ERROR)
    return (depth * np.exp(detail / (1 + (detail / noise) ** 2))).astype(np.float32)
