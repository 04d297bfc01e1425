"""The size at which photos are worked."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.captures.working_size import LARGE_PX, resized_camera, size_note
from room2dgs.geometry.camera import Camera


def camera(width: int, height: int) -> Camera:
    return Camera(
        np.array([[0.8 * width, 0, width / 2], [0, 0.8 * width, height / 2], [0, 0, 1]]), width, height, np.eye(4)
    )


@pytest.mark.parametrize(
    ("size", "image_width", "wide", "expected"),
    [
        ((4032, 3024), "auto", True, (1600, 1200)),
        ((3024, 4032), "auto", True, (1200, 1600)),
        ((3024, 4032), "auto", False, (1200, 1600)),  # photos that all stand upright: the longer side, too
        ((4032, 3024), "full", True, (4032, 3024)),
        ((1600, 1200), "auto", True, (1600, 1200)),
        ((640, 480), "auto", True, (640, 480)),
        ((480, 640), "auto", False, (480, 640)),
        ((640, 480), 320, True, (320, 240)),
        ((480, 640), 320, True, (240, 320)),
        ((480, 640), 320, False, (320, 427)),
        ((640, 480), 2000, True, (640, 480)),
    ],
)
def test_photos_are_worked_at(size, image_width, wide, expected):
    given = camera(*size)
    found = resized_camera(given, image_width, wide)
    assert (found.width, found.height) == expected
    if expected == size:
        assert found is given  # not a bit changes
    np.testing.assert_allclose(found.K[0, 0] / expected[0], given.K[0, 0] / size[0], rtol=1e-3)


def test_a_smaller_size_that_nobody_asked_for_is_said():
    (said,) = size_note([(4032, 3024)] * 3, "auto")
    assert said == f"photos of 4032 px are worked at {LARGE_PX} px; scene.image_width=full uses all pixels"
    (said,) = size_note([(4032, 3024), (2000, 3000), (640, 480)], "auto")
    assert said.startswith("2 of 3 photos of 3000 to 4032 px are worked at 1600 px")
    assert size_note([(640, 480), (1600, 900)], "auto") == []
    assert size_note([(4032, 3024)], "full") == size_note([(4032, 3024)], 640) == []
