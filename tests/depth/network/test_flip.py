"""A photo and its mirror image: what has a side is turned back, what agrees stays, what does not shows in the error."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.config.card import read_card
from room2dgs.depth.network.card import card_format
from room2dgs.depth.network.flip import Prediction, averaged, mirrored_back, mirrored_camera
from room2dgs.depth.network.network import predicted
from room2dgs.depth.network.session import open_network
from room2dgs.geometry.camera import Camera
from tests.depth.cards import write_card

CAMERA = Camera(np.array([[60.0, 0, 6.5], [0, 61.0, 6.0], [0, 0, 1.0]]), 16, 12, np.eye(4))
ALL = np.ones((2, 3), bool)


def test_a_mirrored_camera_sees_the_mirrored_pixel_along_the_mirrored_ray():
    x, depth = np.array([2.5, 3.0, 1.0]), 2.0
    there = np.linalg.inv(mirrored_camera(CAMERA).K) @ [16 - x[0], x[1], 1]
    here = np.linalg.inv(CAMERA.K) @ x
    np.testing.assert_allclose(depth * there, depth * here * [-1, 1, 1])


def test_going_back_turns_x_alone():
    normal = np.array([[[0.6, 0, -0.8], [0, 0, -1], [0, 0.6, -0.8]]], np.float32)
    back = mirrored_back(Prediction(normal, np.array([[True, True, False]]), np.array([[1.0, 2, 3]])))
    np.testing.assert_allclose(back.values[0], [[0, 0.6, -0.8], [0, 0, -1], [-0.6, 0, -0.8]], atol=1e-7)
    np.testing.assert_array_equal(back.valid, [[False, True, True]])
    np.testing.assert_array_equal(back.error, [[3, 2, 1]])


def test_depths_are_averaged_as_logarithms_and_what_differs_is_less_sure():
    one = Prediction(np.full((2, 3), 1.0, np.float32), ALL, np.full((2, 3), 0.1, np.float32))
    other = Prediction(np.full((2, 3), 4.0, np.float32), ALL, np.full((2, 3), 0.3, np.float32))
    mean = averaged(one, other)
    np.testing.assert_allclose(mean.values, 2.0, rtol=1e-6)
    np.testing.assert_allclose(mean.error, 0.2 + np.log(2.0), rtol=1e-6)
    np.testing.assert_allclose(averaged(one, one).error, 0.1, rtol=1e-6)
    assert averaged(one, other._replace(error=None)).error is None
    hole = other._replace(valid=~ALL)
    assert not averaged(one, hole).valid.any()


def test_disparity_may_be_anything():
    below = Prediction(np.full((2, 3), -1.0, np.float32), ALL, None)
    np.testing.assert_allclose(averaged(below, below._replace(values=below.values + 4)).values, 1.0)


def test_normals_are_averaged_to_unit_vectors_and_opposite_ones_are_none():
    def normals(degrees):
        angle = np.radians(degrees)
        return Prediction(np.tile(np.float32([np.sin(angle), 0, -np.cos(angle)]), (2, 3, 1)), ALL, np.zeros((2, 3)))

    mean = averaged(normals(10), normals(50))
    np.testing.assert_allclose(mean.values, normals(30).values, atol=1e-6)
    np.testing.assert_allclose(mean.error, np.radians(20), rtol=1e-4)
    assert not averaged(normals(0), normals(180)).valid.any()


def opened(path, kind, **changes):
    card = read_card(write_card(path.with_suffix(".json"), kind, changes, "room_prior"))
    return open_network(path, kind, card_format(card, kind), 1, "cpu")


@pytest.mark.parametrize("kind", ["depth", "normal"])
def test_a_network_without_a_preferred_side_finds_the_same(room_network, kind):
    # what is read off the second channel is the normal's x, which a mirrored photo does not turn: so it cancels
    photo = np.random.default_rng(0).integers(60, 200, (12, 16, 3)).astype(np.uint8)
    once, both = (predicted(opened(room_network, kind, flip=flip), photo, CAMERA) for flip in ("false", "true"))
    assert once.values.shape == both.values.shape
    if kind == "depth":
        np.testing.assert_allclose(both.values, once.values, rtol=1e-4)
        np.testing.assert_allclose(both.error, once.error, atol=1e-4)
    else:
        np.testing.assert_allclose(both.values[..., 0], 0, atol=1e-4)
        np.testing.assert_allclose(np.linalg.norm(both.values, axis=-1), 1, atol=1e-5)
        np.testing.assert_allclose(both.error, 0.1 + np.arcsin(np.abs(once.values[..., 0])), atol=2e-3)
