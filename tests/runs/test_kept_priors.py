"""Priors that a killed run goes on with: the very bits that were kept, for the same input alone."""

from __future__ import annotations

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.read import read_scene
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import load_config
from room2dgs.depth import Priors
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.runs import kept_priors as module
from room2dgs.runs.kept_priors import keep_priors, kept_priors, key_of


@pytest.fixture
def config(wall, tmp_path):
    return load_config([f"scene.path={wall}", f"out={tmp_path}", "prior=none"])


@pytest.fixture
def scene(config):
    return read_scene(config.scene)


@pytest.fixture
def points() -> PointCloud:
    return PointCloud(np.arange(30.0).reshape(10, 3), np.zeros((10, 3), np.uint8))


@pytest.fixture
def priors(scene) -> Priors:
    random = np.random.default_rng(0)
    maps = StoredMaps()
    for number, frame in enumerate(scene.keyframes):
        depth = random.uniform(1, 4, (6, 8)).astype(np.float32)
        normal = None if number % 2 else random.normal(size=(6, 8, 3)).astype(np.float32)
        maps.put(frame.name, ViewMaps(depth, None if number else depth / 4, normal, source="room_prior"))
    fits = {frame.name: Fit(1.5, 0.25, float("nan") if frame.index else 0.1, 7) for frame in scene.keyframes}
    return Priors(maps, fits, "room_prior", {"depth": "ab12"}, "room_prior")


def test_what_is_kept_comes_back_to_the_bit(scene, priors, tmp_path):
    keep_priors(tmp_path / "kept", "key", priors, print)
    back = kept_priors(tmp_path / "kept", "key", scene)
    assert back.by_frame.cache is (scene.cache or back.by_frame.cache)
    assert list(back.by_frame) == list(priors.by_frame)
    for name, maps in priors.by_frame.items():
        for one, other in zip(maps, back.by_frame[name], strict=True):
            assert (one is None and other is None) or np.array_equal(one, other)
        assert back.by_frame.digest(name) == priors.by_frame.digest(name)
    assert repr(back.fits) == repr(priors.fits)  # NaN and all
    assert (back.label, back.networks, back.depth_source) == ("room_prior", {"depth": "ab12"}, "room_prior")


@pytest.mark.parametrize("damage", ["key", "flip", "cut", "gone", "pickle", "index", "shape"])
def test_others_and_damaged_ones_are_none(scene, priors, tmp_path, damage):
    folder = tmp_path / "kept"
    keep_priors(folder, "key", priors, print)
    path = folder / "000001.npy"
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    if damage == "flip":
        path.write_bytes(data)
    elif damage == "cut":
        path.write_bytes(data[:-9])
    elif damage == "gone":
        path.unlink()
    elif damage == "pickle":
        with path.open("wb") as file:
            for _ in range(4):
                np.save(file, np.array([{}], object), allow_pickle=True)
    elif damage == "index":
        (folder / "index.json").write_text('{"key": "key"}')
    elif damage == "shape":
        (folder / "index.json").write_text(json.dumps(["key"]))
    assert kept_priors(folder, "other" if damage == "key" else "key", scene) is None


def test_a_full_disk_is_told_and_leaves_nothing(priors, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module.np, "save", full)
    lines = []
    keep_priors(tmp_path / "kept", "key", priors, lines.append)
    assert len(lines) == 1 and "priors are not kept" in lines[0]
    assert not list(tmp_path.iterdir())


def test_the_key_is_of_all_that_priors_are_made_of(scene, points, config, tmp_path):
    files = tmp_path / "maps"
    files.mkdir()
    (files / "0.npy").write_bytes(b"one")
    of_files = replace(config, prior=replace(config.prior, depth=replace(config.prior.depth, path=str(files))))
    key, with_files = key_of(scene, points, config), key_of(scene, points, of_files)
    assert key == key_of(scene, points, replace(config, out="elsewhere", prior=replace(config.prior, cache="x")))
    moved = replace(points, xyz=points.xyz + 1e-9)
    coarse = replace(config, stereo=replace(config.stereo, cell_m=0.5))
    others = [key_of(scene, moved, config), key_of(scene, points, coarse), with_files]
    (files / "0.npy").write_bytes(b"three")
    others.append(key_of(scene, points, of_files))
    photo = Path(scene.keyframes[0].color_path)
    content = photo.read_bytes()
    try:
        photo.write_bytes(content + b"x")
        others.append(key_of(read_scene(config.scene), points, config))
    finally:
        photo.write_bytes(content)
    assert len({key, *others}) == 6
