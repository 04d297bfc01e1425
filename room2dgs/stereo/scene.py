"""Dense stereo of a scene's views, from photos on disk and sparse points."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.image_files import whole_at
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.config import StereoConfig
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.view_selection import neighbours_by_points
from room2dgs.kernels.builds import build_of
from room2dgs.logs import Log
from room2dgs.stereo.dense import COARSEST_WIDTH, DenseView, Options, Sight, dense_views
from room2dgs.stereo.patchmatch import Matching, PackedWhenAsked
from room2dgs.stereo.second_pass import second_pass

LOG_SECONDS = 10.0
MOST_PIXELS = 15_000_000  # of a photo: the kernels index theirs, which have a border, with floats
UNKNOWN = np.zeros((1, 1), np.float32)  # depth of a view that has none


class Prepared(NamedTuple):
    """What stereo of some frames begins with.

    Attributes:
        cameras, photos, sights: of the frames, at stereo's image size; photos grey.
        options, matching: the settings.
    """

    cameras: list[Camera]
    photos: list[np.ndarray]
    sights: list[Sight]
    options: Options
    matching: Matching


def scene_stereo(
    frames: Sequence[Frame],
    points: PointCloud,
    settings: StereoConfig,
    log: Log = print,
    device: str = "cpu",
    beside: Sequence[Frame] = (),
) -> tuple[list[Camera], Iterator[DenseView]]:
    """Depth and normals of each view where several views agree.

    Args:
        frames: the views, at their working size.
        points: sparse points, metres; their tracks tell which views see the same.
        log: takes one line at a time.
        device: what matches, as `render.device` names it.
        beside: more views to match with, whose own depth is not wanted.

    Returns:
        The views' cameras at stereo's image size, and what was found in each, in the frames' order; the work is done as
        it is asked for.

    Raises:
        InputError: a photo cannot be decoded, or is too large.
    """
    cameras, photos, sights, options, matching = _prepared([*frames, *beside], points, settings, device)
    views = dense_views(photos, cameras, sights, points.xyz, options, matching, _progress(log), wanted=len(frames))
    return cameras[: len(frames)], (_unmasked(view, frame) for view, frame in zip(views, frames, strict=True))


def scene_second_pass(
    frames: Sequence[Frame],
    points: PointCloud,
    settings: StereoConfig,
    log: Log,
    device: str,
    start: Mapping[str, np.ndarray],
    beside: Sequence[Frame] = (),
) -> tuple[list[Camera], Iterator[tuple[np.ndarray, np.ndarray]]]:
    """Depth, metres, 0 = none, and numbers of consistent views, begun with a depth that is nearly right.

    Args:
        start: frame name -> z-depth in metres, 0 = unknown; frames may have none. Others: as in `scene_stereo`.

    Raises:
        InputError: a photo cannot be decoded, or is too large.
    """
    cameras, photos, sights, options, matching = _prepared([*frames, *beside], points, settings, device)
    views = PackedWhenAsked(photos, cameras, build_of(device))
    known = [partial(_known_depth, start, frame.name) for frame in frames]
    found = second_pass(views, cameras, sights, points.xyz, known, options, matching, _progress(log))
    usable = ((_usable(frame, depth.shape), depth, count) for frame, (depth, count) in zip(frames, found, strict=True))
    return cameras[: len(frames)], ((depth * where, count * where) for where, depth, count in usable)


def _prepared(frames: Sequence[Frame], points: PointCloud, settings: StereoConfig, device: str) -> Prepared:
    cameras = [_camera(frame.camera, settings.width) for frame in frames]
    for frame, camera in zip(frames, cameras, strict=True):
        if camera.width * camera.height > MOST_PIXELS:
            raise InputError(
                f"stereo would compare {frame.color_path} at {camera.width}x{camera.height} pixels, which are "
                "too many; give it smaller photos, such as stereo.width=1600"
            )
    photos = [grey(frame, camera) for frame, camera in zip(frames, cameras, strict=True)]
    sights = [_sight(frame, camera, points) for frame, camera in zip(frames, cameras, strict=True)]
    options = Options(
        num_source_views=settings.num_source_views,
        consistency_views=settings.consistency_views,
        iterations=settings.iterations,
        refinements=settings.refinements,
        rounds=settings.rounds,
        levels=_levels(max(camera.width for camera in cameras)),
        min_num_consistent=settings.min_num_consistent,
        max_reprojection_px=settings.max_reprojection_px,
        max_relative_difference=settings.max_relative_difference,
        max_cost=settings.max_cost,
        device=device,
    )
    return Prepared(
        cameras, photos, sights, options, Matching(radius=settings.radius, step=settings.step, top_k=settings.top_k)
    )


def scene_neighbours(
    frames: Sequence[Frame], cameras: Sequence[Camera], points: PointCloud, count: int
) -> list[np.ndarray]:
    """Indices of each frame's neighbours, best first, so many at most; cameras as of stereo's image size."""
    seen = [_sight(frame, camera, points).points for frame, camera in zip(frames, cameras, strict=True)]
    return neighbours_by_points(cameras, seen, points.xyz, count)


def coverage(views: Sequence[DenseView]) -> np.ndarray:
    """(V,) share of each view's pixels that have a depth."""
    return np.array([np.mean(view.depth > 0) for view in views])


def _known_depth(start: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    return start.get(name, UNKNOWN)


def _levels(width: int) -> int:
    """Image sizes: halves of `width` down to the first that is no wider than the coarsest needs to be."""
    return 1 if width <= COARSEST_WIDTH else 1 + _levels((width + 1) // 2)


def _camera(camera: Camera, width: int | None) -> Camera:
    return camera if width is None or width >= camera.width else camera.resized_to_width(width)


def _unmasked(view: DenseView, frame: Frame) -> DenseView:
    """Without what the photo's mask hides."""
    usable = _usable(frame, view.depth.shape)
    if isinstance(usable, bool):
        return view
    return view._replace(
        depth=view.depth * usable,
        normal=view.normal * usable[..., None],
        num_consistent=view.num_consistent * usable,
        error=view.error * usable,
    )


def _usable(frame: Frame, shape: tuple[int, ...]) -> np.ndarray | bool:
    """(h, w) bool: pixels of which the photo's mask hides no part; True without a mask."""
    mask = frame.mask()
    return True if mask is None else whole_at(mask, (shape[1], shape[0]))


def grey(frame: Frame, camera: Camera) -> np.ndarray:
    """(H, W) uint8 photo at a camera's size."""
    photo = cv2.cvtColor(frame.color(), cv2.COLOR_RGB2GRAY)
    return photo if camera is frame.camera else cv2.resize(photo, camera.size, interpolation=cv2.INTER_AREA)


def _sight(frame: Frame, camera: Camera, points: PointCloud) -> Sight:
    """The points that the photo saw, at stereo's image size."""
    seen = seen_points(points, frame)
    return Sight(seen.index, seen.pixel * np.array(camera.size) / frame.camera.size, seen.depth)


def _progress(log: Log) -> Callable[[str, int, int], None]:
    last = time.monotonic()

    def progress(stage: str, done: int, count: int) -> None:
        nonlocal last
        if time.monotonic() - last > LOG_SECONDS:
            last = time.monotonic()
            log(f"{stage}: {done} of {count} views")

    return progress
