"""Augmented views stay true: photo, depth, normals and intrinsics agree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.tools.make_prior_data import encoded
from room2dgs.tools.prior_network.geometric import random_view, seen_in, view_of
from room2dgs.tools.prior_network.photographic import linear_radiance, photo
from room2dgs.tools.prior_network.shards import Sample

WIDTH, HEIGHT, FOCAL, SIZE = 320, 240, 260.0, (96, 64)


def plane_sample(normal: np.ndarray) -> Sample:
    """A plane two metres ahead; its photo is bright where its truth is at x > 40 px right of the middle."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5 - WIDTH / 2, np.arange(HEIGHT) + 0.5 - HEIGHT / 2)
    rays = np.stack([x / FOCAL, y / FOCAL, np.ones_like(x)], axis=-1)
    depth = 2.0 * normal[2] / (rays @ normal)
    coded = np.broadcast_to(np.round(127 * normal), (HEIGHT, WIDTH, 3)).astype(np.int8)
    radiance = np.where((x > 40)[..., None], 200, 20).astype(np.uint8) * np.ones(3, np.uint8)
    return Sample(radiance, depth.astype(np.float16), coded, FOCAL)


views = {
    "zoom": st.floats(0.6, 1.0),
    "shift": st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    "mirrored": st.booleans(),
    "roll": st.floats(-0.2, 0.2),
}


@settings(deadline=None, max_examples=60)
@given(slant=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)), **views)
def test_a_plane_stays_a_plane_with_its_normal(slant, zoom, shift, mirrored, roll):
    normal = np.array([*slant, -1.0]) / np.linalg.norm([*slant, -1.0])
    seen = seen_in(plane_sample(normal), view_of((WIDTH, HEIGHT), SIZE, zoom, shift, mirrored, roll), SIZE)
    x, y = np.meshgrid(np.arange(SIZE[0] // 2) * 2 + 1.0, np.arange(SIZE[1] // 2) * 2 + 1.0)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(seen.intrinsics).T
    valid = seen.depth > 0
    assert valid.mean() > 0.8
    points, normals = (rays * seen.depth[..., None])[valid], seen.normal[valid]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-5)
    # the plane's distance from the camera does not change; bytes for normals are 0.004 off, and at a
    # grazing ray of this family (n . ray = 0.4) that and the nearest pixel make 2.5 %
    np.testing.assert_allclose((points * normals).sum(axis=-1), 2.0 * normal[2], rtol=0.025)
    assert ((rays[valid] * normals).sum(axis=-1) < 0).all()


@settings(deadline=None, max_examples=40)
@given(**views)
def test_photo_and_truth_show_the_same_place(zoom, shift, mirrored, roll):
    sample = plane_sample(np.array([0.0, 0.0, -1.0]))
    sample = sample._replace(depth=np.where(sample.radiance[..., 0] > 100, 4.0, 2.0).astype(np.float16))
    seen = seen_in(sample, view_of((WIDTH, HEIGHT), SIZE, zoom, shift, mirrored, roll), SIZE)
    bright = seen.radiance.reshape(SIZE[1] // 2, 2, SIZE[0] // 2, 2, 3).mean(axis=(1, 3, 4))
    sure = ((bright > 170) | (bright < 50)) & (seen.depth > 0)
    assert sure.mean() > 0.7
    assert np.array_equal(bright[sure] > 110, seen.depth[sure] > 3.0)


def test_beyond_the_source_there_is_no_truth():
    seen = seen_in(plane_sample(np.array([0.0, 0.0, -1.0])), view_of((WIDTH, HEIGHT), SIZE, roll=0.2), SIZE)
    assert (seen.depth[0, 0], *seen.normal[0, 0]) == (0, 0, 0, 0)
    assert seen.depth[16, 24] > 0


def test_zooming_in_lengthens_the_focal_length():
    sample = plane_sample(np.array([0.0, 0.0, -1.0]))
    whole, part = (seen_in(sample, view_of((WIDTH, HEIGHT), SIZE, zoom), SIZE).intrinsics for zoom in (1.0, 0.5))
    # 320 x 213 pixels of the source go to 96 x 64
    assert whole[0, 0] == pytest.approx(FOCAL * 96 / 320)
    assert part[0, 0] == pytest.approx(2 * whole[0, 0])
    np.testing.assert_allclose(whole[:2, 2], (48, 32), atol=1e-5)


def test_random_views_stay_within_the_source_unless_rolled():
    rng = np.random.default_rng(0)
    for _ in range(50):
        view = random_view((WIDTH, HEIGHT), SIZE, rng)
        if view.roll == 0.0:
            ends = np.array([view.offset, view.offset + view.linear @ SIZE])
            assert (ends > -1e-9).all() and (ends < np.array([WIDTH, HEIGHT]) + 1e-9).all()


def test_radiance_is_read_as_it_was_written():
    light = np.linspace(0.0, 4.0, 300).reshape(10, 10, 3).astype(np.float32)
    np.testing.assert_allclose(linear_radiance(encoded(light)), light, atol=0.02)


def test_photos_follow_from_the_seed_and_differ_between_seeds():
    coded = np.random.default_rng(1).integers(0, 256, (64, 96, 3), dtype=np.uint8)
    made = [photo(coded, np.random.default_rng(seed)) for seed in (5, 5, 6)]
    assert made[0].shape == (64, 96, 3) and made[0].dtype == np.uint8
    assert np.array_equal(made[0], made[1])
    assert not np.array_equal(made[0], made[2])


def test_exposure_follows_the_room_not_the_window():
    dark = np.full((64, 96, 3), 40, np.uint8)
    window = dark.copy()
    window[:16, :16] = 255
    levels = [[np.median(photo(c, np.random.default_rng(seed))) for seed in range(40)] for c in (dark, window)]
    without, beside = np.mean(levels, axis=1)
    assert 70 < without < 150
    assert beside > 0.7 * without


def test_every_photo_is_exposed_whatever_the_lights_power():
    pattern = np.random.default_rng(2).uniform(0.5, 1.0, (64, 96, 3))
    for factor in (0.02, 0.3, 3.0):
        means = [photo(encoded(factor * pattern), np.random.default_rng(seed)).mean() for seed in range(30)]
        assert 60 < np.median(means) < 190
