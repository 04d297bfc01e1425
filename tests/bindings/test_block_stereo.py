"""Stereo by block code (`_C.device`), without torch; also for `make sanitize`.

What it finds is tested in tests/stereo/test_patchmatch.py; here no index may be wrong, at any size, and no block may
read what another one writes.
"""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs import _C

SIZES = [(8, 8), (9, 31), (40, 17)]


def searched(height: int, width: int, queue: int) -> list[np.ndarray]:
    """Planes, costs and variances of noise, beside a view of another size, with depths and hints that say little."""
    random = np.random.default_rng(width)
    grey = random.integers(0, 256, (height, width), np.uint8)
    other = random.integers(0, 256, (height + 3, width + 5), np.uint8)
    kind = _C.device
    photos = [kind.StereoPhoto(grey), kind.StereoPhoto(other)]
    match = kind.PatchMatch(photos[0], 4, 2, 12.0, 4.0, 1.0, 1, 0.2, 2.0, 0.1, 0.05, 7)
    there, back = (np.array([[1, 0, 0, x], [0, 1, 0, 0.3 * x], [0, 0, 1, 0]], np.float64) for x in (2.0, -2.0))
    match.add_view(photos[1], there, back, random.random(other.shape, np.float32))
    planes = random.random((3, height, width), np.float32) * np.array([1, 0.01, 0.01], np.float32)[:, None, None]
    planes[0][random.random((height, width)) < 0.3] = 0
    match.set_planes(planes)
    match.set_hints(planes)
    match.run(3, 1.0, 1, 0.1, 3, True, queue)
    found, cost, variance = np.full_like(planes, np.nan), *(np.full_like(planes[0], np.nan) for _ in range(2))
    match.planes(found)
    match.costs(0.1, cost, variance, queue)
    return [found, cost, variance]


@pytest.mark.parametrize("size", SIZES)
def test_everything_is_written_and_the_same_in_any_order(size):
    plain = searched(*size, 0)
    assert all(np.isfinite(x).all() for x in plain)
    for queue in (1, 12345):
        assert all(np.array_equal(a, b) for a, b in zip(searched(*size, queue), plain, strict=True))
