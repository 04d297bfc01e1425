"""Defaults that measurements of docs/studies chose: to change one is to measure again."""

import pytest

from room2dgs.bench import raster
from room2dgs.config import load_config
from room2dgs.seeds.spawn import first_opacity
from room2dgs.train.schedule import opacity_floor


def test_defaults_are_those_that_were_measured():
    config = load_config(["scene.path=room", "out=run"])
    mesh, train = config.mesh, config.train
    assert (mesh.voxel_m, mesh.truncation_voxels, mesh.min_weight) == (None, 3.0, 1.0)
    assert (mesh.smoothing_steps, mesh.max_error_m) == (5, 0.005)
    assert [(level.fraction, level.until) for level in train.resolutions] == [(0.5, 0.7)] and train.coarsest_px == 320
    assert (train.opacity_floor.value, train.opacity_floor.until) == (1 / 32, 0.9)
    assert train.opacity_floor.value == raster.FLOOR  # what the benchmark draws with
    assert (config.strategy.name, config.strategy.thin, config.seeds.per_seed) == ("seeds", 0.03, 4)
    assert first_opacity(config) == 0.6
    depth = config.prior.depth
    assert depth.completion and depth.planes and depth.right_angles and depth.free_space and depth.second_pass
    assert depth.creases and depth.other_views and depth.correction
    assert config.scene.keyframes == 1
    assert config.stereo.enabled


def test_what_is_compared_with_takes_none_of_ours():
    plain = load_config(["scene.path=room", "out=run", "experiment=plain_2dgs"])
    assert plain.strategy.thin == 0 and plain.train.resolutions == [] and plain.prior.depth.source == "none"
    assert first_opacity(plain) == 0.1  # 2DGS starts with it
    assert opacity_floor(0, plain.train) == 1 / 255  # and skips what is fainter


@pytest.mark.parametrize("setting", ["prior=none", "seeds.init=sfm", "experiment=no_depth", "experiment=no_seed"])
def test_seeds_that_no_depth_has_placed_start_faint(setting):
    assert first_opacity(load_config(["scene.path=room", "out=run", setting])) == 0.1
