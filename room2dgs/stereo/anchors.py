"""Stereo's pixels as points that their photos see: what depth priors are aligned and held to."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import probably_seen
from room2dgs.config import StereoConfig
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.stereo.passes import Compared, FirstPass, Maps, first_of_two, second_pass_of_two, single_pass
from room2dgs.stereo.thinned import thinned

COLUMNS = 160  # of the pixels that are taken: as many as the joint optimisation looks at
# The more views agree on a depth, the more often it is right: a depth of 2 is wrong as often as right.
TRUST = np.array([0, 0.05, 0.25, 0.45, 0.6, 0.75, 0.85, 1.0], np.float32)


class StereoPoints(NamedTuple):
    """What stereo tells the depth priors.

    Attributes:
        points: sparse points and stereo's (`with_stereo`).
        maps: what each photo says, at stereo's size.
    """

    points: PointCloud
    maps: Maps


def stereo_points(
    frames: Sequence[Frame],
    points: PointCloud,
    settings: StereoConfig,
    log: Log = print,
    device: str = "cpu",
    first: FirstPass | None = None,
    *,
    passes: int = 1,
    beside: Sequence[Frame] = (),
) -> StereoPoints:
    """Compare the photos of some frames.

    Args:
        frames: training views.
        points: sparse points, metres.
        device: what matches, as `render.device` names it.
        first: None at the first look; at the second its pixels stay where the second finds nothing.
        passes: how many there will be; a first without a second is at full size.
        beside: more views to match with, whose own depth is not asked for.

    Raises:
        InputError: as `scene_stereo`.
    """
    started = time.monotonic()
    photos = Compared(frames, beside, points, settings, log, device)
    if first:
        cameras, maps = second_pass_of_two(photos, first)
    else:
        cameras, maps = first_of_two(photos) if passes > 1 else single_pass(photos)
    share = np.array([np.mean(depth > 0) for depth, _ in maps.values()])
    stage = "stereo, from the completed depth" if first else "stereo"
    log(
        f"{stage}: {share.mean():.0%} of the pixels of {len(frames)} views have a depth (least {share.min():.0%}), "
        f"{(time.monotonic() - started) / len(frames):.1f} s a view"
    )
    return StereoPoints(with_stereo(points, frames, cameras, maps), maps)


def trust(agreeing: np.ndarray) -> np.ndarray:
    """Trust in a depth that is worth so many agreeing views (`worth`), 0..1; float32 of the same shape."""
    return TRUST[np.minimum(agreeing, len(TRUST) - 1)]


def with_stereo(
    points: PointCloud,
    frames: Sequence[Frame],
    cameras: Sequence[Camera],
    maps: Maps,
) -> PointCloud:
    """The sparse points, and one depth of each block of pixels as a point that only its photo sees (`thinned`).

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
        some = thinned(depth, agreeing, max(1, camera.width // COLUMNS))
        xyz.append(camera.unproject(some.pixel, some.depth))
        pixels.append(some.pixel * (np.array(frame.camera.size) / camera.size))
        frame_of.append(np.full(len(some.pixel), number[frame.name], np.int32))
        weights.append(trust(some.agreeing))
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
