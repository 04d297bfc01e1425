"""Stereo of a capture's photos: what a mask hides has no depth, in either pass."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import StereoConfig, load_config
from room2dgs.errors import InputError
from room2dgs.stereo.scene import scene_second_pass, scene_stereo

HIDDEN = 40  # columns at the first view's left


@pytest.fixture
def frames(tmp_path, corner) -> list[Frame]:
    """The corner's views as files; a mask hides the left of the first."""
    mask = np.full(corner[0][1].shape, 255, np.uint8)
    mask[:, :HIDDEN] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    found = []
    for index, (camera, photo, _, _) in enumerate(corner):
        path = tmp_path / f"{index}.png"
        cv2.imwrite(str(path), photo)
        hidden = PhotoFile(tmp_path / "mask.png") if index == 0 else None
        found.append(Frame(name=str(index), camera=camera, color_path=path, mask_photo=hidden))
    return found


@pytest.fixture
def points(corner) -> PointCloud:
    """Some of what the views see."""
    camera, _, depth, _ = corner[0]
    xyz = camera.unproject_map(depth.astype(np.float32))[::4, ::4].reshape(-1, 3)
    return PointCloud(xyz.astype(np.float64), np.zeros((len(xyz), 3), np.uint8))


@pytest.fixture(scope="module")
def settings() -> StereoConfig:
    return replace(load_config(["scene.path=room", "out=out"]).stereo, width=None, min_num_consistent=2)


@pytest.mark.parametrize("pass_", ["first", "second"])
def test_what_a_mask_hides_has_no_depth_and_nothing_is_consistent_with_it(frames, points, corner, settings, pass_):
    if pass_ == "first":
        _, views = scene_stereo(frames, points, settings)
        found = [(view.depth, view.num_consistent) for view in views]
    else:
        start = {frame.name: depth.astype(np.float32) for frame, (_, _, depth, _) in zip(frames, corner, strict=True)}
        _, pairs = scene_second_pass(frames, points, settings, lambda _: None, "cpu", start)
        found = list(pairs)
    (depth, num_consistent), (open_depth, _) = found[0], found[1]
    assert not depth[:, :HIDDEN].any() and not num_consistent[:, :HIDDEN].any()
    assert np.mean(depth[:, HIDDEN:] > 0) > 0.5 and (num_consistent[depth > 0] >= 2).all()
    assert np.mean(open_depth[:, :HIDDEN] > 0) > 0.2


def test_a_photo_that_is_too_large_for_the_kernels_is_bad_input(frames, points, settings):
    large = [replace(frame, camera=frame.camera.resized(6000, 4000)) for frame in frames]
    with pytest.raises(InputError, match=r"0\.png at 6000x4000 pixels.*stereo\.width=1600"):
        scene_stereo(large, points, settings)
