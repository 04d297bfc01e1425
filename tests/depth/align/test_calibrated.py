"""The unit of a network's confidence, from samples of known depth."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.depth.align.calibrated import ENOUGH, MOST, calibrated_sigmas, error_of_doubt


def test_the_expected_error_is_the_mean_error_of_pixels_that_doubt_alike():
    rng = np.random.default_rng(0)
    doubt = rng.uniform(0, 1, 40000)
    error = np.abs(rng.normal(0, 0.01 + 0.1 * doubt))
    at, sigma = error_of_doubt(doubt, error, np.ones(40000))
    np.testing.assert_allclose(sigma, np.sqrt(2 / np.pi) * (0.01 + 0.1 * at), rtol=0.1)


def test_more_doubt_never_means_less_error():
    rng = np.random.default_rng(1)
    at, sigma = error_of_doubt(rng.uniform(0, 1, 500), rng.uniform(0, 1, 500), np.ones(500))
    assert (np.diff(at) > 0).all() and (np.diff(sigma) >= 0).all()
    # a confidence that says nothing, or the opposite, is one error for all
    at, sigma = error_of_doubt(np.arange(500.0), np.arange(500.0)[::-1], np.ones(500))
    np.testing.assert_allclose(sigma, 249.5)


def test_samples_without_weight_say_nothing():
    doubt = np.arange(400.0)
    error = np.where(doubt % 2, 0.3, 0.01)
    _, sigma = error_of_doubt(doubt, error, 1 - doubt % 2)
    np.testing.assert_allclose(sigma, 0.01)


@pytest.fixture
def doubting(room):
    """Maps 2 % too deep on the left and 20 % on the right, where they doubt; samples that their photos see."""
    left = np.arange(80) < 40
    depths = {
        frame.name: depth * np.where(left, 1.02, 1.2) for frame, depth in zip(room.frames, room.depths, strict=True)
    }
    doubts = {name: np.where(left, 0.4, 30.0) * np.ones((60, 80)) for name in depths}
    rng = np.random.default_rng(0)
    pixel = rng.uniform((0, 0), (80, 60), (len(room.frames), 100, 2))
    xyz = [
        frame.camera.unproject(at, depth[at[:, 1].astype(int), at[:, 0].astype(int)])
        for frame, at, depth in zip(room.frames, pixel, room.depths, strict=True)
    ]
    count = len(room.frames) * 100
    tracks = Tracks(
        tuple(depths), np.repeat(np.arange(len(room.frames), dtype=np.int32), 100), np.arange(count, dtype=np.int32),
        pixel.reshape(-1, 2).astype(np.float32),
    )  # fmt: skip
    points = PointCloud(np.concatenate(xyz), np.zeros((count, 3), np.uint8), tracks)
    return room.frames, depths, doubts, points


def test_maps_get_the_error_that_their_doubt_has_at_the_samples(doubting):
    frames, depths, doubts, points = doubting
    doubts[frames[0].name][0] = np.inf
    sigmas = calibrated_sigmas(frames, depths, doubts, points, lambda line: None)
    for frame in frames:
        sigma = sigmas[frame.name]
        assert sigma.dtype == np.float32 and sigma.shape == (60, 80)
        np.testing.assert_allclose(sigma[1:, :40], np.log(1.02), rtol=1e-2)
        np.testing.assert_allclose(sigma[1:, 40:], np.log(1.2), rtol=1e-2)
    assert np.isinf(sigmas[frames[0].name][0]).all()


def test_a_wrong_sample_counts_as_no_more_than_the_most(doubting):
    frames, depths, doubts, points = doubting
    depths[frames[0].name] = depths[frames[0].name] * 1e3
    sigmas = calibrated_sigmas(frames, depths, doubts, points, lambda line: None)
    assert max(sigma.max() for sigma in sigmas.values()) < MOST


def test_too_few_samples_are_told(doubting):
    frames, depths, doubts, points = doubting
    said: list[str] = []
    some = frames[: ENOUGH // 100 - 1]
    assert not calibrated_sigmas(some, depths, doubts, points, said.append)
    assert "100 samples are too few" in said[0]
