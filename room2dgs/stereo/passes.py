"""Photos compared in one pass or two: narrow windows find exact depth, wide ones find blank walls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs import _C
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import StereoConfig
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.parallel_map import parallel_map
from room2dgs.stereo.consistency import calibrated_consistency
from room2dgs.stereo.contrast import discounted_by_contrast
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.planes import planes_of_depth, resized_planes
from room2dgs.stereo.scene import grey, scene_neighbours, scene_second_pass, scene_stereo


class StereoMap(NamedTuple):
    """One view's depth by stereo, of any size.

    Attributes:
        depth: (H, W) float32 metres, 0 = none.
        num_consistent: (H, W) uint8, how many consistent views it counts as (`calibrated_consistency`).
    """

    depth: np.ndarray
    num_consistent: np.ndarray


StereoMaps = Mapping[str, StereoMap]  # by the frame's name
MAX_RADIUS = 12  # of the kernels' windows, pixels
FIRST_WIDTH = 320  # of photos in a first pass; at 160 its depth is too rough to begin with
# Of windows: what is far, and what stands before walls, comes out more exact with narrow ones.
NARROWER = 0.5


class FirstPass(NamedTuple):
    """What a second pass over the photos begins with.

    Attributes:
        completed: frame name -> (h, w) z-depth, metres, 0 = unknown: the prior's, drawn to what the first pass found.
        maps: of the first pass, at its size.
    """

    completed: Mapping[str, np.ndarray]
    maps: StereoMaps


class StereoInput(NamedTuple):
    """Photos to compare.

    Attributes:
        frames: views whose depth is wanted.
        beside: more views to match with.
        points: sparse points, metres.
        log: takes one line at a time.
        device: what matches, as `render.device` names it.
    """

    frames: Sequence[Frame]
    beside: Sequence[Frame]
    points: PointCloud
    settings: StereoConfig
    log: Log = print
    device: str = "cpu"


def single_pass(photos: StereoInput) -> tuple[list[Camera], dict[str, StereoMap]]:
    """The views' cameras at stereo's size, and their maps with calibrated consistency.

    Raises:
        InputError: as `scene_stereo`.
    """
    cameras, maps = _searched(photos)
    calibrate(photos, cameras, maps)
    return cameras, maps


def first_of_two(photos: StereoInput) -> tuple[list[Camera], dict[str, StereoMap]]:
    """As `single_pass`, of photos of half the width, down to `FIRST_WIDTH`: no detail is needed.

    Blank walls have too little texture for narrow windows; wide ones find them, in photos of half that size.
    """
    width = _first_width(photos)
    smaller = min(width, max(width, FIRST_WIDTH) // 2)
    _, rough = _searched(photos._replace(settings=replace(photos.settings, width=smaller)))
    narrow = with_windows(photos.settings, NARROWER)
    cameras, maps = single_pass(photos._replace(settings=replace(narrow, width=width)))
    for frame, camera in zip(photos.frames, cameras, strict=True):
        depth, num_consistent = rough[frame.name]
        num_consistent = discounted_by_contrast(_enlarged(num_consistent, *camera.size), grey(frame, camera))
        maps[frame.name] = _filled(maps[frame.name], StereoMap(depth, num_consistent))
    return cameras, maps


def second_of_two(photos: StereoInput, first: FirstPass) -> tuple[list[Camera], dict[str, StereoMap]]:
    """As `single_pass`, begun with what the first pass led to; its pixels stay where this one finds nothing."""
    frames, beside, points, settings, log, device = photos
    narrow = with_windows(settings, NARROWER * _full_width(photos) / _first_width(photos))
    cameras, views = scene_second_pass(frames, points, narrow, log, device, first.completed, beside)
    maps = {frame.name: StereoMap(*view) for frame, view in zip(frames, views, strict=True)}
    calibrate(photos, cameras, maps)
    for name, view in maps.items():
        if name in first.maps:
            maps[name] = _filled(view, first.maps[name])
    return cameras, maps


def calibrated_maps(photos: StereoInput, cameras: Sequence[Camera], views: Sequence[DenseView]) -> dict[str, StereoMap]:
    """Maps with calibrated consistency of views that stereo has found already, which stay as they are.

    Args:
        cameras, views: of the frames, in their order.
    """
    maps = {
        frame.name: StereoMap(view.depth.copy(), view.num_consistent)
        for frame, view in zip(photos.frames, views, strict=True)
    }
    calibrate(photos, cameras, maps)
    return maps


def calibrate(photos: StereoInput, cameras: Sequence[Camera], maps: dict[str, StereoMap]) -> None:
    """Replaces numbers of consistent views by calibrated ones, and removes depth that is probably wrong.

    Args:
        maps: by frame name, at the cameras' size. Changed in place: of many views, both at once would take memory.
    """
    settings = photos.settings
    limits = (settings.max_reprojection_px, settings.max_relative_difference)
    names = [frame.name for frame in photos.frames]
    near = scene_neighbours(photos.frames, cameras, photos.points, settings.consistency_views)

    def calibrated(index: int) -> np.ndarray:
        depth, num_consistent = maps[names[index]]
        others = [(cameras[other], maps[names[other]].depth) for other in near[index]]
        return calibrated_consistency((cameras[index], depth), num_consistent, others, *limits)

    found = list(parallel_map(calibrated, range(len(names)), _C.threads()))
    for name, num_consistent in zip(names, found, strict=True):
        depth = maps[name].depth
        depth[num_consistent == 0] = 0
        maps[name] = StereoMap(depth, num_consistent)


def with_windows(settings: StereoConfig, times: float) -> StereoConfig:
    """Settings whose windows are so many times as wide, as far as the kernels have them, with as many samples."""
    step = int(np.clip(round(settings.step * times), 1, MAX_RADIUS * settings.step // settings.radius))
    return replace(settings, step=step, radius=settings.radius // settings.step * step)


def _searched(photos: StereoInput) -> tuple[list[Camera], dict[str, StereoMap]]:
    frames, beside, points, settings, log, device = photos
    cameras, views = scene_stereo(frames, points, settings, log, device, beside)
    maps = {frame.name: StereoMap(view.depth, view.num_consistent) for frame, view in zip(frames, views, strict=True)}
    return cameras, maps


def _first_width(photos: StereoInput) -> int:
    """Of the photos in the first of two passes, pixels."""
    full = _full_width(photos)
    return min(max(FIRST_WIDTH, full // 2), full)


def _full_width(photos: StereoInput) -> int:
    widest = max(frame.camera.width for frame in photos.frames)
    return min(photos.settings.width or widest, widest)


def _filled(fine: StereoMap, rough: StereoMap) -> StereoMap:
    """The first, with the other's depth, of any size, where it has none."""
    height, width = fine.depth.shape
    w = resized_planes(planes_of_depth(rough.depth), width, height)[0]
    consistent = _enlarged(rough.num_consistent, width, height)
    added = (fine.depth == 0) & (w > 0) & (consistent > 0)
    depth = np.where(added, 1 / np.where(added, w, 1), fine.depth)
    return StereoMap(depth, np.where(added, consistent, fine.num_consistent))


def _enlarged(counts: np.ndarray, width: int, height: int) -> np.ndarray:
    return cv2.resize(counts, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
