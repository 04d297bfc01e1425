"""Decoding, resizing and refusing single maps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.depth.files import find_map, read_depth, read_normal
from room2dgs.errors import InputError


@pytest.fixture
def depth_settings(prior_config):
    return lambda **changes: prior_config(**{f"depth__{key}": value for key, value in changes.items()}).depth


@pytest.fixture
def normal_settings(prior_config):
    return lambda **changes: prior_config(**{f"normal__{key}": value for key, value in changes.items()}).normal


@pytest.fixture
def camera(room):
    return room.frames[0].camera


def saved(path, array):
    if path.suffix == ".npy":
        np.save(path, array)
    else:
        cv2.imwrite(str(path), array)
    return path


def test_a_frame_is_found_by_its_name_and_by_its_photos_name(room, tmp_path):
    frame = room.frames[2]
    assert find_map(tmp_path, frame) is None
    first = saved(tmp_path / "6.npy", np.ones((60, 80)))
    assert find_map(tmp_path, frame) == first
    saved(tmp_path / "000006.png", np.ones((60, 80), np.uint16))
    with pytest.raises(InputError, match="maps of the same frame"):
        find_map(tmp_path, frame)


def test_png_counts_millimetres_and_npy_metres(tmp_path, camera, depth_settings):
    png = saved(tmp_path / "a.png", np.full((60, 80), 2500, np.uint16))
    npy = saved(tmp_path / "b.npy", np.full((1, 60, 80), 2.5))
    for path in (png, npy):
        values, valid = read_depth(path, depth_settings(), camera)
        np.testing.assert_allclose(values, 2.5)
        assert valid.all()
    values, _ = read_depth(png, depth_settings(unit_m=0.0002), camera)
    np.testing.assert_allclose(values, 0.5)


@pytest.mark.parametrize("factor", [0.5, 2.0, 0.35])
def test_resizing_keeps_places_and_invents_nothing_between_surfaces(tmp_path, camera, depth_settings, factor):
    height, width = round(60 * factor), round(80 * factor)
    column = (np.arange(width) + 0.5) / width
    depth = np.where(column < 0.5, 1.0 + 0.2 * column, 3.0 + 0.2 * column) * np.ones((height, 1))
    depth[: height // 4] = 0.0
    values, valid = read_depth(saved(tmp_path / "a.npy", depth), depth_settings(), camera)
    x = ((np.arange(80) + 0.5) / 80)[None] * np.ones((60, 1))
    expected = np.where(x < 0.5, 1.0 + 0.2 * x, 3.0 + 0.2 * x)
    inside = valid & (np.abs(x - 0.5) > 1.5 / width)
    assert np.abs(values - expected)[inside].max() < 0.2 / width + 1e-5
    assert not ((values > 1.2) & (values < 2.9)).any()
    assert (values[~valid] == 0).all()
    assert valid.mean() == pytest.approx(0.75, abs=0.05)


def test_resized_normals_are_unit_and_holes_do_not_spread(tmp_path, camera, normal_settings):
    normal = np.zeros((120, 160, 3), np.float32)
    normal[:, :80], normal[:, 80:] = (0, 0, -1), (-0.6, 0, -0.8)
    normal[:30] = 0
    values, valid = read_normal(saved(tmp_path / "a.npy", normal), normal_settings(encoding="npy"), camera)
    np.testing.assert_allclose(np.linalg.norm(values[valid], axis=-1), 1.0, atol=1e-6)
    np.testing.assert_allclose(values[40, 10], (0, 0, -1), atol=1e-6)
    np.testing.assert_allclose(values[40, 70], (-0.6, 0, -0.8), atol=1e-6)
    assert valid.sum() == 45 * 80


def test_normals_with_channels_first_are_the_same(tmp_path, camera, normal_settings, room):
    npy = normal_settings(encoding="npy")
    last, _ = read_normal(saved(tmp_path / "a.npy", room.normals[0]), npy, camera)
    first, _ = read_normal(saved(tmp_path / "b.npy", np.moveaxis(room.normals[0], -1, 0)), npy, camera)
    np.testing.assert_array_equal(last, first)


def test_a_few_nan_are_masked_and_many_refused(tmp_path, camera, depth_settings):
    depth = np.full((60, 80), 2.0)
    depth[:6] = np.nan
    depth[6] = -np.inf
    values, valid = read_depth(saved(tmp_path / "a.npy", depth), depth_settings(), camera)
    assert not valid[:7].any()
    assert valid[7:].all()
    assert np.isfinite(values).all()
    depth[:40] = np.nan
    with pytest.raises(InputError, match=r"a\.npy has 67% NaN"):
        read_depth(saved(tmp_path / "a.npy", depth), depth_settings(), camera)


def test_negative_values_are_invalid_metres_but_valid_relative_depth(tmp_path, camera, depth_settings):
    depth = np.full((60, 80), 2.0)
    depth[:30] = -1.0
    path = saved(tmp_path / "a.npy", depth)
    assert read_depth(path, depth_settings(), camera)[1].sum() == 30 * 80
    assert read_depth(path, depth_settings(meaning="relative_inverse_depth"), camera)[1].all()


@pytest.mark.parametrize(
    ("name", "array", "said"),
    [
        ("a.npy", np.ones((60, 60)), "another shape than the photos"),
        ("a.npy", np.ones((60, 80, 3)), "a depth map is"),
        ("a.npy", np.zeros((60, 80)), "no valid depth"),
        ("a.npy", np.ones((0, 80)), "another shape than the photos"),
        ("a.npy", np.full((60, 80), "x"), "one array of numbers"),
        ("a.png", np.full((60, 80), 7, np.uint8), "16-bit one-channel PNG"),
        ("a.png", np.full((60, 80, 3), 7, np.uint8), "16-bit one-channel PNG"),
    ],
)
def test_unusable_depth_is_refused_by_name(tmp_path, camera, depth_settings, name, array, said):
    with pytest.raises(InputError, match=said) as refused:
        read_depth(saved(tmp_path / name, array), depth_settings(), camera)
    assert str(tmp_path / name) in str(refused.value)


def test_normals_that_are_no_unit_vectors_are_refused(tmp_path, camera, normal_settings, room):
    npy = normal_settings(encoding="npy")
    with pytest.raises(InputError, match="no unit normals"):
        read_normal(saved(tmp_path / "a.npy", 0.5 * (room.normals[0] + 1.0)), npy, camera)
    with pytest.raises(InputError, match="no unit normals"):
        read_normal(saved(tmp_path / "a.png", np.zeros((60, 80, 3), np.uint8)), normal_settings(), camera)
    with pytest.raises(InputError, match=r"encoding=png8"):
        read_normal(saved(tmp_path / "a.npy", room.normals[0]), normal_settings(), camera)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300), st.sampled_from(["a.npy", "a.png"]), st.integers(0, 200))
def test_damaged_files_are_refused_by_name(tmp_path, camera, depth_settings, junk, name, cut):
    whole = saved(tmp_path / name, np.full((60, 80), 2000, np.uint16)).read_bytes()
    path = tmp_path / name
    path.write_bytes(whole[: min(cut, len(whole) - 20)] + junk[: max(0, len(whole) - 40 - cut)])
    with pytest.raises(InputError, match=name.replace(".", r"\.")):
        read_depth(path, depth_settings(), camera)


@pytest.mark.parametrize("header", [b"{'descr': (", b"\x00(\x00", b"{'descr': '<f4', 'shape': 3}", b"[" * 60])
def test_a_header_that_numpy_cannot_parse_is_refused_by_name(tmp_path, camera, depth_settings, header):
    path = tmp_path / "a.npy"
    path.write_bytes(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(64))
    with pytest.raises(InputError, match=r"a\.npy"):
        read_depth(path, depth_settings(), camera)
