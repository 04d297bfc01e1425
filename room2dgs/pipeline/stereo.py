"""Stereo's own depth of a run's photos: what `room2dgs depth` writes and `run mesh.source=stereo` meshes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder

if TYPE_CHECKING:
    from room2dgs.depth import StereoViews
    from room2dgs.geometry.camera import Camera
    from room2dgs.mesh.views import FusedView


def find_stereo(scene: Scene, points: PointCloud, config: Config, run: RunFolder) -> tuple[StereoViews, float]:
    """The training photos compared with each other: depth of the keyframes.

    Returns:
        What was found in each keyframe, and the share of the pixels that have a depth.

    Raises:
        InputError: as `scene_stereo`.
    """
    from room2dgs.depth import StereoViews
    from room2dgs.stereo.scene import coverage, scene_stereo

    with run.timed("stereo"):
        cameras, found = scene_stereo(
            scene.keyframes, points, config.stereo, run.log, config.render.device, scene.beside
        )
        views = list(found)
    share = coverage(views)
    run.log(
        f"stereo: {share.mean():.0%} of the pixels of {len(views)} views have a depth (least {share.min():.0%}), "
        f"{run.times['stereo'] / len(views):.1f} s a view"
    )
    return StereoViews(cameras, views), float(share.mean())


def resized_photos(frames: Sequence[Frame], cameras: Sequence[Camera]) -> Iterator[np.ndarray]:
    """(H, W, 3) uint8 photos at the cameras' sizes and of one exposure, one at a time."""
    import cv2

    for frame, camera in zip(frames, cameras, strict=True):
        yield cv2.resize(frame.levelled_color(), camera.size, interpolation=cv2.INTER_AREA)


def fused_stereo(frames: Sequence[Frame], stereo: StereoViews) -> Iterator[FusedView]:
    """Stereo's depth as it is fused, one view at a time: the pixels that enough views agree with, all of one weight."""
    from room2dgs.mesh.views import FusedView

    photos = resized_photos(frames, stereo.cameras)
    for camera, view, color in zip(stereo.cameras, stereo.views, photos, strict=True):
        yield FusedView(camera, view.depth, color, expected=view.error)
