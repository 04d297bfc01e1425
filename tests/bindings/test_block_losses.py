"""Losses of block code (`_C.device`), without torch; also for `make sanitize`.

What they compute is tested in tests/losses/test_blocks.py; here no index may be wrong, at any size and in any order
of blocks and threads, and what is written is written whole.
"""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs import _C

SIZES = [(1, 1), (1, 17), (17, 1), (16, 16), (5, 5), (33, 47)]


def outputs(height: int, width: int, queue: int) -> list[np.ndarray]:
    """All of them, of random input; NaN where nothing was written."""
    random = np.random.default_rng(height)
    color, target, normal = (random.random((height, width, 3), np.float32) for _ in range(3))
    depth, alpha = (random.random((height, width), np.float32) for _ in range(2))
    depth[random.random(depth.shape) < 0.1] = np.nan
    losses = _C.device.BlockLosses()
    K = np.array([[50.0, 0, width / 2], [0, 52.0, height / 2], [0, 0, 1]], np.float32)
    camera, moved_camera = (K, np.eye(4, dtype=np.float32)), np.eye(4, dtype=np.float32)
    moved_camera[:3, 3] = 0.05, 0.01, -0.02
    to_color, to_normal, normals = (np.full_like(color, np.nan) for _ in range(3))
    to_depth, values, ten = np.full_like(depth, np.nan), np.full(2, np.nan), np.full(10, np.nan)
    losses.rgb_loss(color, target, 0.2, values, to_color, queue)
    losses.normal_consistency(depth, alpha, normal, *camera, to_depth, to_normal, ten, queue)
    losses.depth_normals(depth, *camera, normals, queue)
    valid = (random.random(depth.shape) < 0.9).astype(np.uint8)
    by_depth, one = np.full_like(depth, np.nan), np.full(1, np.nan)
    losses.depth_prior(depth, alpha, alpha, valid, alpha, False, True, 0.5, 4, by_depth, one, queue)
    by_normal, two = np.full_like(normal, np.nan), np.full(2, np.nan)
    prior = random.normal(size=(*valid[::2, ::2].shape, 3)).astype(np.float32)
    of_prior = (prior, valid[::2, ::2].copy(), alpha[::2, ::2].copy())
    losses.normal_prior(normal, alpha, *of_prior, 0.1, 0.2, 2, by_normal, two, queue)
    pixels = random.integers(-1, height * width, 37).astype(np.int32)
    pairs, normals_of, four = (
        np.full((37, 2), np.nan, np.float32),
        np.full((37, 3), np.nan, np.float32),
        np.full(4, np.nan),
    )
    with_depth, towards = np.nan_to_num(depth, nan=1.0) + 1, normal - [0, 0, 3]
    for usable, normal_map in ((None, None), (valid, towards.astype(np.float32))):
        losses.multiview(
            with_depth, normal_map, pixels, alpha, alpha, usable, with_depth[::2, ::2].copy(), 2, *camera, K,
            moved_camera, 5, pairs, normals_of, four, queue,
        )  # fmt: skip
    return [
        values,
        to_color,
        ten,
        to_depth,
        to_normal,
        normals,
        by_depth,
        one,
        by_normal,
        two,
        pairs,
        normals_of,
        four,
    ]


@pytest.mark.parametrize("size", SIZES)
def test_everything_is_written_and_the_same_in_any_order(size):
    plain = outputs(*size, 0)
    assert all(np.isfinite(x).all() for x in plain)
    for queue in (1, 2, 12345):
        assert all(np.array_equal(a, b) for a, b in zip(outputs(*size, queue), plain, strict=True))
