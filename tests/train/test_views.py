from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from room2dgs.errors import InputError
from room2dgs.train.views import Views, load_view


def test_target_is_the_photo_in_rgb_from_0_to_1(capture):
    frame = capture[0].train[0]
    view = Views([frame]).at(0)
    expected = cv2.imread(str(frame.color_path))[:, :, ::-1] / np.float32(255)
    assert view.target().dtype == torch.float32
    np.testing.assert_array_equal(view.target().numpy(), expected.astype(np.float32))


def test_a_smaller_view_sees_the_same_rays(capture):
    frame = capture[0].train[0]
    full, half = load_view(frame, 1.0), load_view(frame, 0.5)
    assert (half.width, half.height) == (16, 12) and half.image.shape == (12, 16, 3)
    point = torch.tensor([0.1, -0.2, 2.0])
    torch.testing.assert_close((half.K @ point)[:2], 0.5 * (full.K @ point)[:2])


def test_a_photo_is_read_once_for_each_size(capture, monkeypatch):
    frame = capture[0].train[0]
    views = Views([frame])
    reads = []
    imread = cv2.imread
    monkeypatch.setattr(cv2, "imread", lambda *args: reads.append(args) or imread(*args))
    for fraction in (0.5, 0.5, 1.0, 1.0):
        views.at(0, fraction)
    assert len(reads) == 2


def test_a_photo_that_vanished_is_named(capture, tmp_path):
    frame = replace(capture[0].train[0], color_path=tmp_path / "gone.png")
    with pytest.raises(InputError, match=r"gone\.png"):
        Views([frame]).at(0)
