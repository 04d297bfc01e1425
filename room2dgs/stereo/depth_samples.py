"""Depth samples: stereo's pixels as points that their photos see, to which depth priors are aligned and drawn."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import probably_seen
from room2dgs.captures.uncertainty import stereo_weight
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.low_res import low_res_step
from room2dgs.stereo.passes import FirstPass, StereoInput, StereoMaps, first_of_two, second_of_two, single_pass
from room2dgs.stereo.thinned import thinned


class DepthSamples(NamedTuple):
    """What stereo gives the depth priors.

    Attributes:
        points: sparse points and stereo's (`with_depth_samples`).
        maps: of each photo, at stereo's size.
    """

    points: PointCloud
    maps: StereoMaps


def stereo_samples(photos: StereoInput, first: FirstPass | None = None, *, passes: int = 1) -> DepthSamples:
    """Compare the photos of some frames.

    Args:
        first: None in the first pass; in the second its pixels stay where the second finds nothing.
        passes: how many there will be; a first without a second is at full size.

    Raises:
        InputError: as `scene_stereo`.
    """
    started = time.monotonic()
    if first:
        cameras, maps = second_of_two(photos, first)
    else:
        cameras, maps = first_of_two(photos) if passes > 1 else single_pass(photos)
    share = np.array([np.mean(depth > 0) for depth, _ in maps.values()])
    stage = "stereo, from the completed depth" if first else "stereo"
    photos.log(
        f"{stage}: {share.mean():.0%} of the pixels of {len(photos.frames)} views have a depth (least "
        f"{share.min():.0%}), {(time.monotonic() - started) / len(photos.frames):.1f} s a view"
    )
    return DepthSamples(with_depth_samples(photos.points, photos.frames, cameras, maps), maps)


def with_depth_samples(
    points: PointCloud,
    frames: Sequence[Frame],
    cameras: Sequence[Camera],
    maps: StereoMaps,
) -> PointCloud:
    """The sparse points, and one depth of each block of pixels as a point that only its photo sees (`thinned`).

    Args:
        points: of the scene; without tracks, what each photo probably sees of them.
        cameras: of the frames, at stereo's size.
        maps: as in `DepthSamples`.
    """
    tracks = points.tracks if points.tracks is not None else _guessed_tracks(points, frames)
    names = list(dict.fromkeys([*tracks.frames, *(frame.name for frame in frames)]))
    number = {name: index for index, name in enumerate(names)}
    xyz, frame_of, pixels, weights = [], [], [], []
    for frame, camera in zip(frames, cameras, strict=True):
        depth, num_consistent = maps[frame.name]
        some = thinned(depth, num_consistent, low_res_step(camera.width))
        xyz.append(camera.unproject(some.pixel, some.depth))
        pixels.append(some.pixel * (np.array(frame.camera.size) / camera.size))
        frame_of.append(np.full(len(some.pixel), number[frame.name], np.int32))
        weights.append(stereo_weight(some.num_consistent))
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
