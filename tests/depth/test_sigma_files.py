"""A network's expected error on its way to a weight, and maps that lie on the disk with it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.captures.uncertainty import measured_weight
from room2dgs.depth.network.map_cache import is_cached, is_empty, read_array, write_map
from room2dgs.depth.sources.map_files import has_sigma, read_sigma
from room2dgs.errors import InputError


@pytest.fixture
def settings(prior_config):
    return prior_config("prior=room_prior", depth__error_scale=0.2, depth__max_error=1.0).depth


def weight_of(error, settings):
    return measured_weight(error, settings.error_scale, settings.max_error)


def test_weights_of_known_errors(settings):
    error = np.array([[0.0, 0.1, 0.2, 0.6], [1.0, 1.01, np.inf, np.nan]], np.float32)
    expected = [[1, 0.8, 0.5, 0.1], [1 / 26, 0, 0, 0]]
    np.testing.assert_allclose(weight_of(error, settings), expected, rtol=1e-5)
    assert weight_of(error, settings).dtype == np.float32


@given(st.floats(1e-3, 10), st.floats(0, 10), st.floats(0, 10))
def test_a_larger_error_never_has_more_weight(scale, one, other):
    small, large = sorted((one, other))
    found = measured_weight(np.array([[small, large]]), scale, 10.0)
    assert 0 <= found[0, 1] <= found[0, 0] <= 1


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3)])
def test_a_map_comes_back_with_its_error(tmp_path, shape):
    rng = np.random.default_rng(0)
    values = rng.uniform(0.5, 1.0, shape).astype(np.float32)
    valid = rng.random((5, 7)) > 0.3
    error = rng.uniform(0.01, 0.5, (5, 7)).astype(np.float32)
    path = tmp_path / "folder" / "map.npz"
    assert not is_cached(path, shape)
    write_map(path, values, valid, error)
    assert is_cached(path, shape) and not is_cached(path, (7, 5)) and not is_empty(path)
    found = read_array(path, "map")
    np.testing.assert_allclose(found[valid], values[valid], rtol=2e-3)
    assert (found[~valid] == 0).all() and found.dtype == np.float32
    found = read_array(path, "error")
    np.testing.assert_allclose(found[valid], error[valid], rtol=1e-3)
    assert np.isinf(found[~valid]).all()
    assert [file.name for file in path.parent.iterdir()] == ["map.npz"]


def test_depths_beyond_half_precision_are_kept_whole(tmp_path):
    path = tmp_path / "map.npz"
    write_map(path, np.full((2, 2), 1e6, np.float32), np.ones((2, 2), bool), np.full((2, 2), 1e-7, np.float32))
    np.testing.assert_array_equal(read_array(path, "map"), 1e6)
    np.testing.assert_allclose(read_array(path, "error"), 1e-7, rtol=1e-6)


def test_without_an_error_there_is_no_sigma(tmp_path):
    write_map(tmp_path / "map.npz", np.ones((2, 2), np.float32), np.ones((2, 2), bool), None)
    assert read_array(tmp_path / "map.npz", "error") is None
    assert read_sigma(tmp_path / "map.npz") is None and not has_sigma(tmp_path / "map.npz")
    np.save(tmp_path / "map.npy", np.ones((2, 2)))
    assert read_sigma(tmp_path / "map.npy") is None and not has_sigma(tmp_path / "map.npy")


def test_nothing_valid_is_remembered_without_a_map(tmp_path):
    path = tmp_path / "map.npz"
    write_map(path, np.ones((2, 2), np.float32), np.zeros((2, 2), bool), np.ones((2, 2), np.float32))
    assert is_empty(path) and is_cached(path, (2, 2)) and not path.exists()


@pytest.mark.parametrize("keep", [0, 10, 100, -30])
def test_what_is_damaged_is_not_kept_and_named(tmp_path, keep):
    path = tmp_path / "map.npz"
    write_map(path, np.ones((9, 9), np.float32), np.ones((9, 9), bool), None)
    path.write_bytes(path.read_bytes()[:keep])
    assert not is_cached(path, (9, 9))
    with pytest.raises(InputError, match=r"map\.npz cannot be read; delete it"):
        read_array(path, "map")


def test_a_pickle_is_not_opened(tmp_path):
    path = tmp_path / "map.npz"
    np.savez(path, map=np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match="cannot be read"):
        read_array(path, "map")
