"""Fusion by block code (`_C.device`), without torch; also for `make sanitize`.

What it makes of a room is tested in tests/mesh/test_device_volume.py; here no index may be wrong, whatever the depth
map and the camera, and bad arguments are refused.
"""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs import _C

HALF = 2**20
SIZES = [(1, 1), (4, 4), (3, 50), (33, 47)]
PARTS = (512, 512, 512, 1536)


def depth_of(height: int, width: int) -> np.ndarray:
    random = np.random.default_rng(width)
    depth = random.uniform(0.5, 3, (height, width)).astype(np.float32)
    depth[random.random(depth.shape) < 0.1] = np.nan
    depth[random.random(depth.shape) < 0.1] = 1e38
    depth[random.random(depth.shape) < 0.1] = -1
    return depth


def normals_of(depth: np.ndarray) -> np.ndarray:
    """Some unknown, some that look away, some NaN."""
    normal = np.random.default_rng(7).normal(size=(*depth.shape, 3)).astype(np.float32)
    normal[::3] = 0
    normal[1::5] = np.nan
    return normal


def touched(depth: np.ndarray, pose: np.ndarray, order: int = 0) -> np.ndarray:
    height, width = depth.shape
    K = np.array([[30.0, 0, width / 2], [0, 31.0, height / 2], [0, 0, 1]])
    keys = np.full(((height // 2) * (width // 2), 4), -7)
    _C.device.touched_blocks(depth, normals_of(depth), K, pose, 0.08, 0.05, keys, order)
    return keys


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("away", [0.0, 83_886.0, 1e9, np.nan])
def test_keys_name_blocks_within_reach_or_nothing(size, away):
    pose = np.eye(3, 4)
    pose[:, 3] = away
    keys = touched(depth_of(*size), pose)
    found = keys[keys != -1]
    assert ((found >= 0) & (found < 2**63 - 1)).all() and (away != 0 or size < (2, 2) or len(found))
    if away == 1e9 or np.isnan(away):
        assert not len(found)
    if away == 0:
        corner = np.stack([found // (2 * HALF) ** 2, found // (2 * HALF) % (2 * HALF), found % (2 * HALF)], axis=-1)
        assert (abs(0.08 * (corner - HALF)) < 5).all()
    assert np.array_equal(touched(depth_of(*size), pose, 5), keys)


@pytest.mark.parametrize("size", SIZES)
def test_voxels_are_taken_in_wherever_the_camera_stands(size):
    random = np.random.default_rng(3)
    depth = depth_of(*size)
    photo, trust = random.random((*size, 3), np.float32), random.random(size, np.float32)
    block = random.integers(-4, 4, (30, 3)).astype(np.int32)
    block[0] = 2**31 - 1, -(2**31), 0
    row = random.permutation(40)[:30]
    row[1:4] = -1, 40, 2**62
    for scale in (1.0, 1e-8, 1e30):
        matrix = scale * random.normal(size=(3, 4))
        made = []
        for order in (0, 8):
            parts = [np.zeros((40, count), np.float32) for count in PARTS]
            _C.device.fuse_depth(block, row, *parts, depth, normals_of(depth), trust, photo, matrix, 0.01, 0.05, order)
            made.append(parts)
        assert all(np.array_equal(a, b) and np.isfinite(a).all() for a, b in zip(*made, strict=True))


def test_arguments_are_checked():
    depth, keys, K, pose = np.ones((8, 9), np.float32), np.zeros((16, 4), np.int64), np.eye(3), np.eye(3, 4)
    normal = np.zeros((8, 9, 3), np.float32)
    for wrong, kind in (
        ((depth, normal, K, pose, 0.08, 0.05, keys[:15]), ValueError),
        ((depth, normal, K, pose, 0.0, 0.05, keys), ValueError),
        ((depth, normal, K, pose, 0.08, np.nan, keys), ValueError),
        ((depth, normal, K, np.eye(4), 0.08, 0.05, keys), ValueError),
        ((depth.astype(np.float64), normal, K, pose, 0.08, 0.05, keys), TypeError),
        ((depth, normal, K, pose.astype(np.float32), 0.08, 0.05, keys), TypeError),
    ):
        with pytest.raises(kind):
            _C.device.touched_blocks(*wrong)
        with pytest.raises(kind):
            _C.touched_blocks(*wrong)
    parts = [np.zeros((2, count), np.float32) for count in PARTS]
    block, row, photo = np.zeros((1, 3), np.int32), np.zeros(1, np.int64), np.ones((8, 9, 3), np.float32)
    for wrong in (
        (block, row, *parts, depth, normal, depth[:4], photo, pose, 0.01, 0.05),
        (block, row, *parts, depth, normal[:4], depth, photo, pose, 0.01, 0.05),
        (block, row, *parts, depth, normal, depth, photo, np.zeros((3, 4)), 0.01, 0.05),
        (block, row, *parts, depth, normal, depth, photo, pose, 0.0, 0.05),
        (block, row[:0], *parts, depth, normal, depth, photo, pose, 0.01, 0.05),
        (block, row, parts[0], *parts[:1], *parts[2:], depth, normal, depth, photo, pose, 0.01, 0.05),
        (block, row, *parts, depth, normal, depth, photo, pose, 0.01, 0.0),
    ):
        with pytest.raises(ValueError):
            _C.device.fuse_depth(*wrong)
