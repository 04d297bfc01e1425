"""What free space does while depth is held to planes: which samples find them, and what the prior may still say."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from room2dgs.depth.completion.free_space import FreeSpace, seen_through
from room2dgs.depth.completion.interpolate import interpolated
from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.depth.completion.room_planes import samples_of
from room2dgs.depth.completion.solve import prior_slopes
from room2dgs.depth.completion.targets import drawn_to_planes
from room2dgs.geometry.camera import Camera

SHAPE = (40, 40)
DEPTH_M = 2.0


@pytest.fixture
def left_is_seen_through(make) -> tuple[Camera, FreeSpace]:
    """A camera at the origin that looks along x, and a space of which 2000 views look through all that lies left."""
    camera = make.camera_at((0.0, 0.0, 0.0), (1.0, 0, 0), pixels=40, half_angle_deg=30)
    left = camera.unproject(np.array([[0.5, SHAPE[0] / 2]]), np.array([DEPTH_M]))[0]
    through = np.zeros((1, 2, 1), np.int32)
    through[0, int(left[1] > 0)] = 2000
    return camera, FreeSpace(np.array([-10.0, -20.0, -10.0]), 20.0, through, np.zeros_like(through))


def maps_of(camera: Camera, sample: np.ndarray) -> LowResInput:
    """Two halves that nothing ties together."""
    prior, ones, tie = np.full(SHAPE, DEPTH_M, np.float32), np.ones(SHAPE), np.ones(SHAPE)
    tie[:, 19:21] = 0
    normal = np.broadcast_to(-camera.forward, (*SHAPE, 3)).astype(np.float32)
    edges = (np.ones((40, 39)), np.ones((39, 40)))
    photo = np.zeros((*SHAPE, 3), np.float32)
    return LowResInput(camera, photo, normal, sample, ones * (sample > 0), prior, ones, prior_slopes(prior), tie, edges)


def completed_at_prior(maps: LowResInput) -> Completed:
    none = np.zeros(SHAPE, np.float32)
    return Completed(maps.camera, maps.sample, maps.sample_weight, none, maps.prior, none)


def test_samples_that_others_pass_through_are_drawn_less(left_is_seen_through):
    camera, space = left_is_seen_through
    maps = maps_of(camera, np.zeros(SHAPE))
    samples = samples_of([maps], [completed_at_prior(maps)], [np.full(SHAPE, 0.001, np.float32)], space)
    share = seen_through(space, samples.xyz)
    assert 0.3 < (share > 0).mean() < 0.7 and share.max() > 0.5
    np.testing.assert_allclose(samples.weight, samples.weight.max() * (1 - share) ** 2, rtol=1e-6)


def test_the_prior_has_no_say_where_others_pass_through_it(left_is_seen_through):
    """Few samples everywhere say 2 % farther; only on the left does the depth follow them."""
    camera, space = left_is_seen_through
    sample = np.zeros(SHAPE)
    sample[::6, ::6] = 1.02 * DEPTH_M
    maps = maps_of(camera, sample)
    drawn = [drawn_to_planes(maps, completed_at_prior(maps), [], one) for one in (space, None)]
    with ThreadPoolExecutor(1) as pool:
        result, unaware = (one.depth / DEPTH_M for one in interpolated(drawn, pool))
    assert np.median(result[:, :18]) > 1.015 and np.median(unaware[:, :18]) < 1.01
    np.testing.assert_allclose(result[:, 22:], unaware[:, 22:], atol=2e-3)
