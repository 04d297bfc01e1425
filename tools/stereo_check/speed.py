"""How fast dense stereo is for what this machine can do: what more threads give, and the bare loop of its NCC.

The *bare loop* compares windows of a photo so small that everything lies in the cache, on one thread: the least that
a window of eight pixels in one view can cost.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np

from room2dgs.bench.timing import best_seconds
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import StereoConfig
from room2dgs.geometry.camera import Camera
from room2dgs.splat import set_threads
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.patchmatch import Matching, Packed, Search, packed, warp
from room2dgs.stereo.scene import grey, scene_stereo

LANES = 8  # pixels that the kernels compare at once
PLANES_TRIED = 11  # of a pixel in a sweep without a random depth or a hint: 8 arms, 3 perturbations
TIMED_PHOTOS = 12  # of a capture, for the scaling with threads
SMALL = (64, 48)  # pixels, of the bare loop's photo
SMALL_VIEWS = 6
REPEATS, SMALL_REPEATS = 3, 40
EDGE = 2.0  # a window's centre keeps this far from a view's border, pixels


class Speed(NamedTuple):
    """Ratios within one run.

    Attributes:
        scaling: seconds on one thread by those on all; 1 with a single one.
        over_bare: seconds of a sweep on one thread by those that the bare loop takes for as many windows.
    """

    scaling: float
    over_bare: float


def speed(
    frames: Sequence[Frame],
    points: PointCloud,
    settings: StereoConfig,
    cameras: Sequence[Camera],
    views: Sequence[DenseView],
    threads: int,
) -> Speed:
    """Both ratios; leaves `threads` set.

    Args:
        cameras, views: what stereo found for these frames.
        threads: of the columns that are compared with one.
    """
    try:
        scaling = thread_scaling(frames[:TIMED_PHOTOS], points, settings, threads)
        set_threads(1)
        return Speed(scaling, sweep_over_bare(frames, settings, cameras, views))
    finally:
        set_threads(threads)


def thread_scaling(frames: Sequence[Frame], points: PointCloud, settings: StereoConfig, threads: int) -> float:
    """Seconds of the whole stage on one thread by those on `threads`."""
    if threads == 1:
        return 1.0
    seconds = []
    for count in (1, threads):
        set_threads(count)
        start = time.perf_counter()
        for _ in scene_stereo(frames, points, settings, lambda line: None)[1]:
            pass
        seconds.append(time.perf_counter() - start)
    return seconds[0] / seconds[1]


def sweep_over_bare(
    frames: Sequence[Frame], settings: StereoConfig, cameras: Sequence[Camera], views: Sequence[DenseView]
) -> float:
    """One start and one sweep over the capture's middle photo by the bare loop's time for its windows.

    The planes are those that were found, so that what is tried lies where views see it.
    """
    matching = Matching(radius=settings.radius, step=settings.step, top_k=settings.top_k)
    middle = len(frames) // 2
    near = nearest(cameras, middle, settings.num_source_views)
    here, *others = [packed(grey(frames[index], cameras[index]), cameras[index]) for index in (middle, *near)]
    planes = views[middle].planes
    search = Search(here, others, matching, (0.1, 100.0), 1)
    windows = sum(windows_seen(here.camera, other.camera, planes[0]) for other in others) * (1 + PLANES_TRIED)
    seconds = best_seconds(lambda: search.run(planes, 1), REPEATS)
    return seconds / (windows * bare_seconds(matching)) if windows else float("nan")


def nearest(cameras: Sequence[Camera], index: int, count: int) -> list[int]:
    """The views whose centres are next to that of a view, the nearest first."""
    away = np.linalg.norm([camera.centre - cameras[index].centre for camera in cameras], axis=1)
    return [int(other) for other in np.argsort(away, kind="stable") if other != index][:count]


def windows_seen(camera: Camera, other: Camera, inverse_depth: np.ndarray) -> int:
    """How many vectors of windows the kernels compare with a view: those of which it sees a pixel at least.

    Args:
        inverse_depth: (H, W), of the photo's planes, 1/m.
    """
    height, width = inverse_depth.shape
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    u, v, z = np.einsum("ij,jhw->ihw", warp(camera, other), np.stack([x, y, np.ones_like(x), inverse_depth]))
    safe = np.where(z > 0, z, 1.0)
    u, v = u / safe, v / safe
    seen = (z > 0) & (u >= EDGE) & (u <= other.width - 1 - EDGE) & (v >= EDGE) & (v <= other.height - 1 - EDGE)
    whole = np.pad(seen, ((0, 0), (0, -width % (2 * LANES))))
    # a vector holds every second pixel of a row
    return int(whole.reshape(height, -1, LANES, 2).any(axis=2).sum())


def bare_seconds(matching: Matching) -> float:
    """Seconds of a vector of windows in one view, on one thread.

    What is paid once a photo is not in it: it is the difference between several views and one.
    """
    width, height = SMALL
    noise = np.random.default_rng(0).normal(size=(height, width)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    photo = np.clip(128 + 60 * smooth / smooth.std(), 0, 255).astype(np.uint8)
    K = np.array([[60.0, 0.0, width / 2], [0.0, 60.0, height / 2], [0.0, 0.0, 1.0]])
    views = []
    for step in range(SMALL_VIEWS + 1):
        pose = np.eye(4)
        pose[0, 3] = 0.004 * step  # a fraction of a pixel: nothing leaves the picture
        views.append(packed(photo, Camera(K, width, height, pose)))
    planes = np.zeros((3, height, width), np.float32)
    planes[0] = 0.5
    alike = replace(matching, top_k=1)  # of one view there is no second best

    def costs(others: Sequence[Packed]) -> Callable[[], Any]:
        search = Search(views[0], others, alike, (0.1, 100.0), 1)
        return lambda: search.costs(planes)

    several, one = (best_seconds(costs(views[1 : 1 + count]), SMALL_REPEATS) for count in (SMALL_VIEWS, 1))
    vectors = sum(windows_seen(views[0].camera, other.camera, planes[0]) for other in views[2:])
    return max(several - one, 1e-12) / vectors
