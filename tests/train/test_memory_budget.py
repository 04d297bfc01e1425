"""What is kept in memory changes no bit of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.captures.cache import Cache
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.train import train

SETTINGS = [
    "loss.depth_prior.start=0",
    "loss.normal_prior.start=0",
    "loss.multiview_geometric.enabled=true",
    "loss.multiview_geometric.start=2",
    "loss.multiview.samples=100",
    "loss.multiview.patch=5",
    "train.resolutions=[{fraction: 0.5, until: 5}]",
    "train.coarsest_px=1",
    "train.iterations=12",
    "seeds.init=sfm+depth",
]


@pytest.mark.parametrize("budget_mb", [0.0, 0.02])
def test_any_budget_gives_the_same_bits_and_leaves_no_file(capture, configure, log, tmp_path, budget_mb):
    def run(name: str, cache: Cache) -> bytes:
        scene = replace(capture[0], cache=cache)
        priors = StoredMaps(cache)
        for index, frame in enumerate(scene.train):
            normal = np.zeros((24, 32, 3), np.float32)
            normal[:] = np.sin(0.1 * index), 0, -np.cos(0.1 * index)
            depth = np.full((24, 32), 1.5 + 0.01 * index, np.float32)
            priors.put(frame.name, ViewMaps(depth, np.linspace(0, 1, 32, dtype=np.float32) + 0 * depth, normal))
        cache.use_folder(tmp_path / f"{name} cache")
        surfels = train(scene, capture[1], configure(*SETTINGS), tmp_path / name, log, priors).surfels_path.read_bytes()
        assert (tmp_path / f"{name} cache").exists() == (name == "small")
        cache.clear()
        assert not (tmp_path / f"{name} cache").exists()
        return surfels

    assert run("small", Cache(budget_mb)) == run("large", Cache())
