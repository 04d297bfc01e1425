"""Shards of photos of random rooms: what is stored agrees with itself and comes out the same again."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.tools import make_prior_data
from room2dgs.tools.make_prior_data import BRIGHTEST, encoded, main

pytestmark = pytest.mark.slow

NAMES = ["depth.npy", "focal.npy", "normal.npy", "radiance.npy"]


@pytest.fixture(scope="module")
def small():
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"WIDTH": 64, "HEIGHT": 48, "ROOMS": 1, "VIEWS": 3}.items():
            patch.setattr(make_prior_data, name, value)
        yield


@pytest.fixture(scope="module")
def made(small, tmp_path_factory):
    out = tmp_path_factory.mktemp("data")
    assert main([str(out), "--rooms", "2", "--seed", "5"]) == 0
    return out


def arrays(shard):
    return {path.stem: np.load(path) for path in shard.iterdir()}


def test_a_shard_holds_four_arrays_of_one_length(made):
    shards = sorted(made.iterdir())
    assert [shard.name for shard in shards] == ["shard_00000", "shard_00001"]
    for shard in shards:
        assert sorted(path.name for path in shard.iterdir()) == NAMES
        found = arrays(shard)
        assert found["radiance"].shape == found["normal"].shape == (3, 48, 64, 3)
        assert found["depth"].shape == (3, 48, 64) and found["focal"].shape == (3,)
        assert [found[name].dtype for name in ("radiance", "depth", "normal", "focal")] == [
            np.uint8,
            np.float16,
            np.int8,
            np.float32,
        ]


def test_depth_and_normals_are_of_the_same_surface(made):
    """On flat pieces the normal is that of the plane through the pixel's neighbours."""
    angles = []
    for shard in made.iterdir():
        found = arrays(shard)
        for depth, normal, focal in zip(found["depth"].astype(float), found["normal"], found["focal"], strict=True):
            x, y = np.meshgrid((np.arange(64) + 0.5 - 32) / focal, (np.arange(48) + 0.5 - 24) / focal)
            rays = np.stack([x, y, np.ones_like(x)], -1)
            points = rays * depth[..., None]
            across, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
            from_depth = np.cross(down, across)
            from_depth /= np.maximum(np.linalg.norm(from_depth, axis=-1, keepdims=True), 1e-9)
            known = normal.any(-1)
            assert (known == (depth > 0)).all()
            unit = normal / np.maximum(np.linalg.norm(normal.astype(float), axis=-1, keepdims=True), 1)
            assert ((unit * rays).sum(-1)[known] < 0.02).all()
            inside = known[1:-1, 1:-1] & known[1:-1, 2:] & known[1:-1, :-2] & known[2:, 1:-1] & known[:-2, 1:-1]
            angles.append(np.degrees(np.arccos(np.clip((from_depth * unit[1:-1, 1:-1]).sum(-1), -1, 1)))[inside])
    assert np.percentile(np.concatenate(angles), 50) < 3.0  # half-precision depth, 8-bit normals


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(made, small, tmp_path):
    assert main([str(tmp_path / "again"), "--rooms", "1", "--seed", "5"]) == 0
    assert main([str(tmp_path / "other"), "--rooms", "1", "--seed", "6"]) == 0
    for name in NAMES:
        first = (made / "shard_00000" / name).read_bytes()
        assert first == (tmp_path / "again" / "shard_00000" / name).read_bytes()
        assert first != (tmp_path / "other" / "shard_00000" / name).read_bytes()


def test_shards_that_are_there_are_kept(made, small):
    before = (made / "shard_00001" / "depth.npy").stat().st_mtime_ns
    assert main([str(made), "--rooms", "2", "--seed", "5"]) == 0
    assert (made / "shard_00001" / "depth.npy").stat().st_mtime_ns == before


def test_encoding_keeps_two_stops_above_white():
    assert encoded(np.array([0.0, BRIGHTEST, 2 * BRIGHTEST])).tolist() == [0, 255, 255]
    back = BRIGHTEST * (encoded(np.array([0.05, 0.5, 1.0, 3.0])) / 255.0) ** 2.2
    np.testing.assert_allclose(back, [0.05, 0.5, 1.0, 3.0], rtol=0.03)


@pytest.mark.parametrize("wrong", [["--rooms", "0"], ["--workers", "0"]])
def test_impossible_options_are_said(wrong, tmp_path, capsys):
    assert main([str(tmp_path / "out"), *wrong]) == 2
    assert "at least 1" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_file_in_the_way_is_said(tmp_path, capsys):
    (tmp_path / "out").write_text("mine")
    assert main([str(tmp_path / "out")]) == 2
    assert "is not a folder" in capsys.readouterr().err
