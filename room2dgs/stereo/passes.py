"""Photos compared once or twice: narrow windows say what is exact, wide ones what blank walls have."""

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
from room2dgs.stereo.contrast import believed
from room2dgs.stereo.planes import planes_of_depth, resized_planes
from room2dgs.stereo.scene import grey, scene_neighbours, scene_second_pass, scene_stereo
from room2dgs.stereo.worth import worth

Map = tuple[np.ndarray, np.ndarray]  # (H, W) depth, metres, 0 = none, and (H, W) uint8 views that it is worth
Maps = Mapping[str, Map]  # by the frame's name
MAX_RADIUS = 12  # of the kernels' windows, pixels
FIRST_WIDTH = 320  # of photos that a first look is at; at 160 its depth is too rough to begin with
# Of windows: what is far, and what stands before walls, comes out more exact with narrow ones.
NARROWER = 0.5


class FirstPass(NamedTuple):
    """What a second look at the photos begins with.

    Attributes:
        completed: frame name -> (h, w) z-depth, metres, 0 = unknown: the prior's, held to what the first look found.
        maps: of the first look, at its size.
    """

    completed: Mapping[str, np.ndarray]
    maps: Maps


class Compared(NamedTuple):
    """Photos that are compared: the frames, more to match with whose own depth is not asked for, and sparse points.

    Attributes:
        device: what matches, as `render.device` names it.
    """

    frames: Sequence[Frame]
    beside: Sequence[Frame]
    points: PointCloud
    settings: StereoConfig
    log: Log
    device: str


def single_pass(photos: Compared) -> tuple[list[Camera], dict[str, Map]]:
    """The views' cameras at stereo's size, and what their photos say: views count as far as all else bears them out.

    Raises:
        InputError: as `scene_stereo`.
    """
    cameras, maps = _searched(photos)
    weigh(photos, cameras, maps)
    return cameras, maps


def first_of_two(photos: Compared) -> tuple[list[Camera], dict[str, Map]]:
    """As `single_pass`, of photos of half the width, down to `FIRST_WIDTH`: no detail is needed.

    Blank walls have too little texture for narrow windows, and are told by wide ones, of photos of half that size.
    """
    width = _first_width(photos)
    smaller = min(width, max(width, FIRST_WIDTH) // 2)
    _, rough = _searched(photos._replace(settings=replace(photos.settings, width=smaller)))
    narrow = with_windows(photos.settings, NARROWER)
    cameras, maps = single_pass(photos._replace(settings=replace(narrow, width=width)))
    for frame, camera in zip(photos.frames, cameras, strict=True):
        depth, agreeing = rough[frame.name]
        agreeing = believed(_enlarged(agreeing, *camera.size), grey(frame, camera))
        maps[frame.name] = _filled(*maps[frame.name], depth, agreeing)
    return cameras, maps


def second_pass_of_two(photos: Compared, first: FirstPass) -> tuple[list[Camera], dict[str, Map]]:
    """As `single_pass`, begun with what the first look led to; its pixels stay where this one finds nothing."""
    frames, beside, points, settings, log, device = photos
    narrow = with_windows(settings, NARROWER * _full_width(photos) / _first_width(photos))
    cameras, views = scene_second_pass(frames, points, narrow, log, device, first.completed, beside)
    maps = {frame.name: view for frame, view in zip(frames, views, strict=True)}
    weigh(photos, cameras, maps)
    for name, view in maps.items():
        if name in first.maps:
            maps[name] = _filled(*view, *first.maps[name])
    return cameras, maps


def _searched(photos: Compared) -> tuple[list[Camera], dict[str, Map]]:
    frames, beside, points, settings, log, device = photos
    cameras, views = scene_stereo(frames, points, settings, log, device, beside)
    return cameras, {frame.name: (view.depth, view.agreeing) for frame, view in zip(frames, views, strict=True)}


def weigh(photos: Compared, cameras: Sequence[Camera], maps: dict[str, Map]) -> None:
    """Puts the views that each depth is worth (`worth`) in place of those that agree; what is rather wrong goes.

    Args:
        maps: frame name -> (H, W) depth and (H, W) views that agree, at the cameras' size. Changed where they are: of
            many views, both at once would take memory.
    """
    settings = photos.settings
    names = [frame.name for frame in photos.frames]
    near = scene_neighbours(photos.frames, cameras, photos.points, settings.consistency_views)

    def views(index: int) -> np.ndarray:
        depth, agreeing = maps[names[index]]
        others = [(cameras[other], maps[names[other]][0]) for other in near[index]]
        return worth(
            (cameras[index], depth), agreeing, others, settings.max_reprojection_px, settings.max_relative_difference
        )

    found = list(parallel_map(views, range(len(names)), _C.threads()))
    for name, one in zip(names, found, strict=True):
        depth = maps[name][0]
        depth[one == 0] = 0
        maps[name] = depth, one


def _first_width(photos: Compared) -> int:
    """Of the first of two looks' photos, pixels."""
    full = _full_width(photos)
    return min(max(FIRST_WIDTH, full // 2), full)


def with_windows(settings: StereoConfig, times: float) -> StereoConfig:
    """Settings whose windows are so many times as wide, as far as the kernels have them, with as many samples."""
    step = int(np.clip(round(settings.step * times), 1, MAX_RADIUS * settings.step // settings.radius))
    return replace(settings, step=step, radius=settings.radius // settings.step * step)


def _full_width(photos: Compared) -> int:
    widest = max(frame.camera.width for frame in photos.frames)
    return min(photos.settings.width or widest, widest)


def _filled(depth: np.ndarray, agreeing: np.ndarray, rough: np.ndarray, agreed: np.ndarray) -> Map:
    """With depth of another look, of any size, and the views that agree on it, where there is none."""
    height, width = depth.shape
    w = resized_planes(planes_of_depth(rough), width, height)[0]
    agreed = _enlarged(agreed, width, height)
    added = (depth == 0) & (w > 0) & (agreed > 0)
    return np.where(added, 1 / np.where(added, w, 1), depth), np.where(added, agreed, agreeing)


def _enlarged(counts: np.ndarray, width: int, height: int) -> np.ndarray:
    return cv2.resize(counts, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
