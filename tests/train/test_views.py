from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from room2dgs.captures import photos
from room2dgs.captures.cache import Cache
from room2dgs.captures.image_files import read_photo
from room2dgs.captures.lens import Lens
from room2dgs.captures.photos import PhotoBytes
from room2dgs.errors import InputError
from room2dgs.train.views import Views


def test_target_is_the_photo_in_rgb_from_0_to_1(capture):
    frame = capture[0].train[0]
    view = Views([frame]).at(0)
    expected = cv2.imread(str(frame.color_path))[:, :, ::-1] / np.float32(255)
    assert view.target().dtype == torch.float32
    np.testing.assert_array_equal(view.target().numpy(), expected.astype(np.float32))


def test_a_smaller_view_sees_the_same_rays(capture):
    frame = capture[0].train[0]
    views = Views([frame])
    full, half = views.at(0), views.at(0, 0.5)
    assert (half.width, half.height) == (16, 12) and half.image.shape == (12, 16, 3)
    point = torch.tensor([0.1, -0.2, 2.0])
    torch.testing.assert_close((half.K @ point)[:2], 0.5 * (full.K @ point)[:2])


@pytest.mark.parametrize("budget_mb", [1500.0, 0.0])
def test_a_photo_is_decoded_once_for_all_sizes_whatever_the_budget(capture, monkeypatch, budget_mb):
    views = Views(capture[0].train, cache=Cache(budget_mb))
    reads = []
    monkeypatch.setattr(photos, "read_photo", lambda *args: reads.append(args) or read_photo(*args))
    for fraction in (0.5, 0.5, 1.0, 1.0):
        for index in range(len(views)):
            views.at(index, fraction)
    assert len(reads) == len(views)


def test_frames_of_one_file_are_told_apart_in_one_cache(capture):
    """By lens, by video frame or part of an archive, and by mask."""
    frame = capture[0].train[0]
    pixels = [np.full((24, 32, 3), level, np.uint8) for level in (10, 200)]
    inside = [
        PhotoBytes(f"video.mp4#{index}", lambda one=one: cv2.imencode(".png", one)[1].tobytes())
        for index, one in enumerate(pixels)
    ]
    lens = Lens("SIMPLE_RADIAL", (30.0, 16.0, 12.0, 0.4), (32, 24))
    masks = [
        PhotoBytes(
            f"mask {level}", lambda level=level: cv2.imencode(".png", np.full((24, 32), level, np.uint8))[1].tobytes()
        )
        for level in (0, 255)
    ]
    frames = [
        frame,
        replace(frame, lens=lens),
        *(replace(frame, photo=one) for one in inside),
        *(replace(frame, mask_photo=one) for one in masks),
    ]
    together, alone = Views(frames, cache=Cache()), [Views([one], cache=Cache()) for one in frames]
    for fraction in (1.0, 0.5):
        for index, views in enumerate(alone):
            assert torch.equal(together.photo(index, fraction), views.photo(0, fraction)), index
            known = [found.mask(place, fraction) for found, place in ((together, index), (views, 0))]
            assert all(one is None for one in known) or torch.equal(*known), index
        assert together.photo(2, fraction).float().mean() == 10 and together.photo(3, fraction).float().mean() == 200
        assert not torch.equal(together.photo(0, fraction), together.photo(1, fraction))


def test_a_photo_that_vanished_is_named(capture, tmp_path):
    frame = replace(capture[0].train[0], color_path=tmp_path / "gone.png")
    with pytest.raises(InputError, match=r"gone\.png"):
        Views([frame]).at(0)
