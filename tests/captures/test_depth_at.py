"""A depth map between its pixels."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.captures.depth_at import depth_at
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import Camera


def camera(width: int, height: int) -> Camera:
    f = 1.1 * width
    K = np.array([[f, 0, width / 2 + 0.7], [0, f, height / 2 - 0.4], [0, 0, 1]])
    return Camera(K, width, height, np.eye(4))


def depth_of_plane(seen: Camera, normal: np.ndarray) -> np.ndarray:
    return 2.0 / (seen.rays() @ normal)


@settings(deadline=None)
@given(st.sampled_from([1, 2, 3, 4, 5]), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_a_slanted_plane_is_exact_at_any_whole_ratio(ratio, across, down):
    """By the nearest pixel it was half a pixel off: 4 mm at 2 m, and all to one side."""
    normal = np.array([across, down, 1.0])
    full, small = camera(40 * ratio, 30 * ratio), camera(40 * ratio, 30 * ratio).resized(40, 30)
    found = depth_at(depth_of_plane(full, normal), small.pixels() * ratio)
    np.testing.assert_allclose(found, depth_of_plane(small, normal), rtol=1e-6)


def test_a_photo_s_own_pixels_are_kept_to_the_bit():
    depth = np.random.default_rng(0).uniform(0, 5, (7, 9)).astype(np.float32)
    depth[2, 3] = 0
    assert np.array_equal(depth_at(depth, camera(9, 7).pixels()), depth)


def test_nothing_lies_between_two_surfaces_or_beside_a_hole():
    depth = np.full((4, 8), 1.0, np.float32)
    depth[:, 4:] = 3.0
    depth[0, 0] = 0
    found = depth_at(depth, np.stack(np.meshgrid(np.linspace(0.1, 7.9, 60), np.linspace(0.1, 3.9, 40)), axis=-1))
    assert set(np.unique(found)) == {0.0, 1.0, 3.0}


@pytest.mark.parametrize("pixel", [(-0.1, 1), (8.0, 1), (3, -1), (3, 4.0), (np.nan, 1), (np.inf, 1), (3, -np.inf)])
def test_outside_of_the_map_is_nothing(pixel):
    assert depth_at(np.ones((4, 8), np.float32), np.array(pixel)) == 0


@pytest.mark.parametrize("by_map", [False, True])
def test_a_frame_made_smaller_has_the_depth_of_its_pixels_centres(tmp_path, by_map):
    full = camera(640, 480)
    normal = np.array([0.1, 0.35, 1.0])
    path = tmp_path / "0.png"
    cv2.imwrite(str(path), np.rint(depth_of_plane(full, normal) * 1e4).astype(np.uint16))
    seen = full.resized(160, 120)
    depth_map = depth_file(path, 1e-4) if by_map else None
    frame = Frame("0", seen, tmp_path / "0.jpg", path, depth_unit_m=1e-4, depth_map=depth_map)
    np.testing.assert_allclose(frame.depth(), depth_of_plane(seen, normal), atol=1e-4)
