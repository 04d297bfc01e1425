"""SIFT features: where they lie, how they are told apart, and that nothing but the photo decides them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.sfm.features import features
from room2dgs.side_by_side import side_by_side

SIDE = 96


def blobs(centres, sigma=3.0, side=SIDE) -> np.ndarray:
    """(side, side, 3) uint8: bright blobs at pixels whose centres lie at +0.5."""
    at = np.arange(side) + 0.5
    light = sum(np.exp(-((at[None] - x) ** 2 + (at[:, None] - y) ** 2) / (2 * sigma**2)) for x, y in centres)
    return np.repeat((40 + 200 * np.clip(light, 0, 1)).round().astype(np.uint8)[..., None], 3, axis=2)


def noise(seed=0, side=160) -> np.ndarray:
    image = np.random.default_rng(seed).integers(0, 256, (side, side, 3)).astype(np.uint8)
    return cv2.GaussianBlur(image, (0, 0), 1.5)


@pytest.mark.parametrize("centre", [(48.0, 40.5), (47.3, 51.9), (30.25, 60.75)])
def test_a_blob_is_found_where_it_is(centre):
    found = features(blobs([centre]), None, 100, 0.003).keypoints
    offset = np.abs(found[:, :2] - centre).max(axis=1)
    assert offset.min() < 0.06  # a careless enlargement costs a quarter of a pixel


def test_a_photo_moved_by_pixels_has_the_same_features_moved():
    image = noise(side=200)
    first, second = (features(np.ascontiguousarray(part), None, 5000, 0.003) for part in (image[:160], image[32:192]))
    inside = (first.keypoints[:, 1] > 72) & (first.keypoints[:, 1] < 128)
    product = second.descriptors.astype(np.int64) @ first.descriptors[inside].astype(np.int64).T
    matched = second.keypoints[product.argmax(axis=0)]
    moved = first.keypoints[inside][:, :2] - matched[:, :2]
    assert inside.sum() > 20
    assert (np.abs(moved - [0, 32]).max(axis=1) < 0.05).mean() > 0.95


def test_descriptors_are_roots_of_shares():
    found = features(noise(), None, 1000, 0.003).descriptors
    assert found.dtype == np.uint8 and found.shape[1] == 128 and len(found) > 100
    length = np.linalg.norm(found.astype(float), axis=1)
    assert np.abs(length - 512).max() < 12  # rounding, and what is cut at 255


def test_hidden_pixels_have_none_and_the_strongest_are_kept():
    image, usable = noise(), np.zeros((160, 160), bool)
    usable[:, 80:] = True
    every, visible = features(image, None, 5000, 0.003), features(image, usable, 5000, 0.003)
    assert visible.keypoints[:, 0].min() >= 80
    assert 0.3 < len(visible.keypoints) / len(every.keypoints) < 0.7
    assert len(features(image, None, 50, 0.003).keypoints) == 50
    assert len(features(image, None, 5000, 0.03).keypoints) < len(every.keypoints)


@pytest.mark.parametrize("image", [np.full((40, 50, 3), 128, np.uint8), np.zeros((1, 1, 3), np.uint8)])
def test_a_photo_without_anything_has_no_features(image):
    found = features(image, None, 100, 0.003)
    assert found.keypoints.shape == (0, 4) and found.descriptors.shape == (0, 128)


def test_threads_change_nothing():
    images = [noise(seed) for seed in range(6)]
    before = cv2.getNumThreads()
    found = []
    try:
        for inner, outer in ((1, 1), (4, 1), (4, 3), (1, 3)):
            cv2.setNumThreads(inner)
            found.append(list(side_by_side(lambda image: features(image, None, 300, 0.003), images, outer)))
    finally:
        cv2.setNumThreads(before)
    for other in found[1:]:
        for one, two in zip(found[0], other, strict=True):
            assert np.array_equal(one.keypoints, two.keypoints) and np.array_equal(one.descriptors, two.descriptors)
