"""Stereo's pixels as points that their photos see: what depth priors are aligned and held to."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import probably_seen
from room2dgs.config import StereoConfig
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.stereo.contrast import believed
from room2dgs.stereo.planes import planes_of_depth, resized_planes
from room2dgs.stereo.scene import grey, scene_second_look, scene_stereo

Maps = Mapping[str, tuple[np.ndarray, np.ndarray]]  # frame name -> depth, number of agreeing views
COLUMNS = 160  # of the pixels that are taken: as many as the joint optimisation looks at
MAX_RADIUS = 12  # of the kernels' windows, pixels
FIRST_WIDTH = 320  # of photos that a first look is at; at 160 its depth is too rough to begin with
# Of the second look's windows: what is far, and what stands before walls, comes out more exact; what has too little
# texture for them has the first look's depth.
NARROWER = 0.5
# The more views agree on a depth, the more often it is right: a depth of 2 is wrong as often as right.
TRUST = np.array([0, 0.05, 0.25, 0.45, 0.6, 0.75, 0.85, 1.0], np.float32)


class StereoPoints(NamedTuple):
    """What stereo tells the depth priors.

    Attributes:
        points: sparse points and stereo's (`with_stereo`).
        maps: frame name -> (H, W) depth, metres, 0 = none, and (H, W) number of agreeing views; at stereo's size.
    """

    points: PointCloud
    maps: Maps


class FirstLook(NamedTuple):
    """What a second look at the photos begins with.

    Attributes:
        completed: frame name -> (h, w) z-depth, metres, 0 = unknown: the prior's, held to what the first look found.
        maps: of the first look, as in `StereoPoints`.
    """

    completed: Mapping[str, np.ndarray]
    maps: Maps


def stereo_points(
    frames: Sequence[Frame],
    points: PointCloud,
    settings: StereoConfig,
    log: Log = print,
    device: str = "cpu",
    first: FirstLook | None = None,
    *,
    looks: int = 1,
    beside: Sequence[Frame] = (),
) -> StereoPoints:
    """Compare the photos of some frames.

    Args:
        frames: training views.
        points: sparse points, metres.
        device: what matches, as `render.device` names it.
        first: None at the first look; at the second its pixels stay where the second finds nothing.
        looks: how many there will be. The first of two needs no detail, and finds more of what has little texture in
            photos of half the width, down to `FIRST_WIDTH`; the second's windows cover half of their width.
        beside: more views to match with, whose own depth is not asked for.

    Raises:
        InputError: as `scene_stereo`.
    """
    started = time.monotonic()
    if looks > 1:
        widest = max(frame.camera.width for frame in frames)
        full = min(settings.width or widest, widest)
        half = min(max(FIRST_WIDTH, full // 2), full)
        settings = with_windows(settings, NARROWER * full / half) if first else replace(settings, width=half)
    maps: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    if first:
        cameras, found = scene_second_look(frames, points, settings, log, device, first.completed, beside)
        for frame, camera, one in zip(frames, cameras, found, strict=True):
            earlier = first.maps.get(frame.name)
            maps[frame.name] = _filled(*one, *earlier, grey(frame, camera)) if earlier else one
    else:
        cameras, views = scene_stereo(frames, points, settings, log, device, beside)
        maps = {frame.name: (view.depth, view.agreeing) for frame, view in zip(frames, views, strict=True)}
    share = np.array([np.mean(depth > 0) for depth, _ in maps.values()])
    stage = "stereo, from the completed depth" if first else "stereo"
    log(
        f"{stage}: {share.mean():.0%} of the pixels of {len(frames)} views have a depth (least {share.min():.0%}), "
        f"{(time.monotonic() - started) / len(frames):.1f} s a view"
    )
    return StereoPoints(with_stereo(points, frames, cameras, maps), maps)


def with_windows(settings: StereoConfig, times: float) -> StereoConfig:
    """Settings whose windows are so many times as wide, as far as the kernels have them, with as many samples."""
    step = int(np.clip(round(settings.step * times), 1, MAX_RADIUS * settings.step // settings.radius))
    return replace(settings, step=step, radius=settings.radius // settings.step * step)


def _filled(
    depth: np.ndarray, agreeing: np.ndarray, earlier: np.ndarray, agreed: np.ndarray, photo: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Depth and number of agreeing views, with the earlier ones where there is no depth; `photo` is grey, (H, W)."""
    height, width = depth.shape
    w = resized_planes(planes_of_depth(earlier), width, height)[0]
    agreed = believed(cv2.resize(agreed, (width, height), interpolation=cv2.INTER_NEAREST_EXACT), photo)
    added = (depth == 0) & (w > 0) & (agreed > 0)
    return np.where(added, 1 / np.where(added, w, 1), depth), np.where(added, agreed, agreeing)


def trust(agreeing: np.ndarray) -> np.ndarray:
    """Trust in a depth on which so many other views agree, 0..1; float32 of the same shape."""
    return TRUST[np.minimum(agreeing, len(TRUST) - 1)]


def with_stereo(
    points: PointCloud,
    frames: Sequence[Frame],
    cameras: Sequence[Camera],
    maps: Maps,
) -> PointCloud:
    """The sparse points, and every few pixels with a depth as a point that only its photo sees.

    Args:
        points: of the scene; without tracks, what each photo probably sees of them.
        cameras: of the frames, at stereo's size.
        maps: as in `StereoPoints`.
    """
    tracks = points.tracks if points.tracks is not None else _guessed_tracks(points, frames)
    names = list(dict.fromkeys([*tracks.frames, *(frame.name for frame in frames)]))
    number = {name: index for index, name in enumerate(names)}
    xyz, frame_of, pixels, weights = [], [], [], []
    for frame, camera in zip(frames, cameras, strict=True):
        depth, agreeing = maps[frame.name]
        step = max(1, camera.width // COLUMNS)
        row, column = np.nonzero(depth[step // 2 :: step, step // 2 :: step])
        row, column = row * step + step // 2, column * step + step // 2
        pixel = np.stack([column, row], axis=1) + 0.5
        xyz.append(camera.unproject(pixel, depth[row, column]))
        pixels.append(pixel * (np.array(frame.camera.size) / camera.size))
        frame_of.append(np.full(len(pixel), number[frame.name], np.int32))
        weights.append(trust(agreeing[row, column]))
    added = sum(map(len, xyz))
    return PointCloud(
        np.concatenate([points.xyz, *xyz]),
        np.concatenate([points.rgb, np.zeros((added, 3), np.uint8)]),
        Tracks(
            tuple(names),
            np.concatenate([tracks.frame, *frame_of]),
            np.concatenate([tracks.point, np.arange(added, dtype=np.int32) + len(points)]).astype(np.int32),
            np.concatenate([tracks.pixel, *pixels]).astype(np.float32),
        ),
        np.concatenate([points.weight_of(np.arange(len(points))), *weights]).astype(np.float32),
    )


def _guessed_tracks(points: PointCloud, frames: Sequence[Frame]) -> Tracks:
    seen = [probably_seen(points.xyz, frame.camera) for frame in frames]
    return Tracks(
        tuple(frame.name for frame in frames),
        np.repeat(np.arange(len(frames), dtype=np.int32), [len(one.index) for one in seen]),
        np.concatenate([one.index for one in seen]).astype(np.int32),
        np.concatenate([one.pixel for one in seen]).astype(np.float32),
    )
