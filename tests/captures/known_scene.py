"""Which of the made scene's photos a frame is, whatever its name and place, and what is wrong about it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.made import Made


class Known(NamedTuple):
    """What a frame of an undamaged capture was read as: (4, 4) world_from_cam, (3, 3) K, (H, W) metres or None, and
    (H, W) bool or None."""

    pose: np.ndarray
    K: np.ndarray
    depth: np.ndarray | None
    mask: np.ndarray | None


def photo_of(frame: Frame, made: Made) -> int:
    """Index of the made photo that a frame shows; JPEG and MPEG are off by under 12 levels, another photo by 60."""
    pixels = frame.color()[..., ::-1].astype(np.float32)
    apart = [np.abs(pixels - photo).mean() if pixels.shape == photo.shape else np.inf for photo in made.photos]
    best = int(np.argmin(apart))
    assert apart[best] < 15, (frame.name, apart)
    return best


def known(scene: Scene, made: Made) -> dict[int, Known]:
    """What each photo of a scene was read as."""
    return {
        photo_of(frame, made): Known(frame.camera.world_from_cam, frame.camera.K, frame.depth(), frame.mask())
        for frame in scene.frames
    }


def wrong(scene: Scene, made: Made, truth: dict[int, Known]) -> list[str]:
    """What differs from the undamaged capture: poses, K, depth and masks of the photos that were read. What is not
    there any more is not wrong: a frame, its depth, its mask."""
    found = []
    for frame in scene.frames:
        index = photo_of(frame, made)
        right = truth[index]
        if not np.allclose(frame.camera.world_from_cam, right.pose, rtol=0, atol=1e-6):
            found.append(f"pose of photo {index} ({frame.name})")
        if not np.allclose(frame.camera.K, right.K, rtol=0, atol=1e-4):
            found.append(f"K of photo {index} ({frame.name})")
        if depth_is_wrong(frame, right.depth):
            found.append(f"depth of photo {index} ({frame.name})")
        mask = frame.mask()
        if mask is not None and right.mask is not None and (mask != right.mask).any():
            found.append(f"mask of photo {index} ({frame.name})")
    return found


def depth_is_wrong(frame: Frame, right: np.ndarray | None) -> bool:
    try:
        depth = frame.depth()
    except InputError:
        return False
    if depth is None:
        return False
    return right is None or not np.allclose(depth, right, rtol=0, atol=1e-5)
