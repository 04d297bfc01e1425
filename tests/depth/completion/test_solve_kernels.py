"""The kernels that solve for completed depth, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C
from room2dgs.depth.completion.solve import System, solved
from tests.oracles.completion import solved_reference


def drawn_system(rng: np.random.Generator, height: int, width: int) -> System:
    """A fifth of the pixels have samples, none of the left third; some ties are cut, some images have no prior."""
    shape = height, width
    sample = (rng.random(shape) < 0.2) * rng.random(shape)
    sample[:, : width // 3] = 0
    prior = 0.5 * rng.random(shape) * (rng.random(shape) < 0.3) * (rng.random() < 0.7)
    distance = np.where(sample > 0, rng.normal(0, 0.05, shape), 0)
    ties = [10 * rng.random(one) ** 4 * (rng.random(one) < 0.95) for one in ((height, width - 1), (height - 1, width))]
    steps = [rng.normal(0, 0.02, one.shape) for one in ties]
    return System(distance, sample, prior, *ties, *steps)


@settings(deadline=None)
@given(height=st.integers(1, 23), width=st.integers(1, 23), count=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
def test_kernels_solve_what_scipy_solves(height, width, count, seed):
    rng = np.random.default_rng(seed)
    systems = [drawn_system(rng, height, width) for _ in range(count)]
    for r, one in zip(solved(systems), systems, strict=True):
        np.testing.assert_allclose(r, solved_reference(one), rtol=0, atol=1e-9)


@pytest.mark.parametrize("shape", [(120, 160), (160, 120), (90, 160), (160, 67)])
def test_whole_images_likewise(shape):
    rng = np.random.default_rng(0)
    systems = [drawn_system(rng, *shape) for _ in range(2)]
    for r, one in zip(solved(systems), systems, strict=True):
        assert np.ptp(r) > 0.05
        np.testing.assert_allclose(r, solved_reference(one), rtol=0, atol=1e-9)


def test_an_image_is_solved_alike_alone_and_among_others_of_any_size():
    rng = np.random.default_rng(1)
    systems = [drawn_system(rng, *shape) for shape in [(12, 16)] * 6 + [(16, 12)] * 3 + [(12, 16)]]
    together = solved(systems)
    assert all(np.array_equal(one, solved([part])[0]) for one, part in zip(together, systems, strict=True))


def test_the_same_bits_on_any_number_of_threads():
    rng = np.random.default_rng(2)
    systems = [drawn_system(rng, 30, 40) for _ in range(21)]
    before = _C.threads()
    found = []
    try:
        for count in (1, 3):
            _C.set_threads(count)
            found.append(np.stack(solved(systems)))
    finally:
        _C.set_threads(before)
    assert np.array_equal(*found)


def test_nothing_anywhere_is_no_change():
    none = np.zeros((8, 9))
    ties = np.ones((8, 8)), np.ones((7, 9))
    assert not solved([System(none, none, none, *ties, *(0 * tie for tie in ties))])[0].any()


def test_no_image_is_no_result():
    assert solved([]) == []
