"""What the small images take from a photo's maps and points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.depth.completion.low_res import enlarged, low_res_input
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.depth_samples import with_depth_samples
from room2dgs.stereo.passes import StereoMap

NOTHING = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))


def floor(camera: Camera) -> np.ndarray:
    """z-depth of a floor 1.2 m under a camera that looks a little down, as far as 5 m."""
    rays = camera.rays()
    down = rays[..., 1] * np.cos(0.5) + np.sin(0.5)
    return np.where(down > 0.24, 1.2 / np.where(down > 0.24, down, 1), 0).astype(np.float32)


@pytest.mark.parametrize("width", [320, 640, 480])
def test_prior_and_stereo_are_those_of_the_pixels_centres(tmp_path, width):
    """Half a pixel to one side would be a floor that is centimetres lower."""
    height = width * 3 // 4
    K = np.array([[0.8 * width, 0, width / 2], [0, 0.8 * width, height / 2], [0, 0, 1]])
    camera = Camera(K, width, height, np.eye(4))
    cv2.imwrite(str(tmp_path / "a.jpg"), np.full((height, width, 3), 128, np.uint8))
    frame = Frame(name="a", color_path=tmp_path / "a.jpg", camera=camera)
    depth = floor(camera)
    points = with_depth_samples(
        NOTHING, [frame], [camera], {"a": StereoMap(depth, np.full(depth.shape, 8, np.uint8) * (depth > 0))}
    )
    maps = low_res_input(frame, depth, None, None, None, points, 0.0)
    exact = floor(maps.camera)
    inside = cv2.erode(((exact > 0) & (maps.sample > 0)).astype(np.uint8), np.ones((3, 3))) > 0
    assert inside.mean() > 0.4 and maps.camera.width == 160
    for found in (maps.sample, maps.prior):
        np.testing.assert_allclose(found[inside], exact[inside], rtol=1e-3)


def test_a_map_is_enlarged_up_to_its_holes_without_them():
    values, known = np.full((12, 16), 0.1, np.float32), np.ones((12, 16), bool)
    known[3:6, 8:] = False
    values[~known] = 0
    np.testing.assert_allclose(enlarged(values, known, (48, 64)), 0.1, rtol=1e-6)
    assert (enlarged(np.zeros((12, 16), np.float32), np.zeros((12, 16), bool), (48, 64)) == 0).all()


def test_a_whole_map_is_interpolated():
    ramp = np.arange(16, dtype=np.float32)[None].repeat(12, axis=0)
    found = enlarged(ramp, np.ones((12, 16), bool), (24, 32))
    np.testing.assert_allclose(np.diff(found[:, 1:-1], axis=1), 0.5, rtol=1e-6)
