"""The multi-view terms in the loop: who acts when, and that a resumed run is the same run."""

import dataclasses

import numpy as np
import pytest
import torch

from room2dgs.captures.view_maps import ViewMaps
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.splat.types import Rendering
from room2dgs.train import checkpoint, load_surfels, train
from room2dgs.train.neighbour_views import NeighbourViews
from room2dgs.train.objective import needed_maps
from room2dgs.train.terms.multiview import multiview_terms
from room2dgs.train.views import Views
from tests.oracles.multiview_terms import drawn_pixels

ON = [
    f"loss.{name}.{setting}"
    for name in ("multiview_geometric", "multiview_photometric")
    for setting in ("enabled=true", "start=2")
]
SMALL = ["loss.multiview.samples=100", "loss.multiview.patch=5", "loss.multiview.min_baseline_m=0.05"]


def filled(scene, config, iteration=5):
    """Neighbour views that hold a wall 1.5 m before each camera."""
    views = NeighbourViews(Views(scene.train), config)
    for index in range(len(scene.train)):
        views.keep(iteration - 1, index, torch.full((24, 32), 1.5), torch.ones(24, 32))
    return views


def test_both_terms_are_logged_and_weighted(capture, configure, log, tmp_path):
    weights = ["loss.multiview_geometric.weight=0.3", "loss.multiview_photometric.weight=0.7"]
    off = ["loss.normal_consistency.enabled=false", "train.iterations=24", "train.log_every=1"]
    result = train(*capture, configure(*ON, *SMALL, *weights, *off), tmp_path, log)
    losses = result.losses
    assert losses["multiview_photometric"] > 0 and losses["multiview_geometric"] > 0
    total = losses["rgb"] + 0.3 * losses["multiview_geometric"] + 0.7 * losses["multiview_photometric"]
    assert losses["loss"] == pytest.approx(total, rel=1e-5)
    assert result.seconds["multiview"] > 0
    named = ["multiview_geometric" in line for line in log.lines if ": loss" in line]
    # not before its start, and not before a neighbour was rendered
    assert named[:2] == [False, False] and all(named[4:])


def test_they_change_the_result_and_have_a_toggle_each(capture, configure, log, tmp_path):
    def bits(name, *overrides):
        path = train(*capture, configure(*SMALL, *overrides, "train.iterations=12"), tmp_path / name, log).surfels_path
        return [values.numpy().tobytes() for values in load_surfels(path)]

    geometric, photometric = ON[:2], ON[2:]
    results = [bits("off"), bits("geo", *geometric), bits("pho", *photometric), bits("both", *ON)]
    assert all(a != b for i, a in enumerate(results) for b in results[:i])


EVENTS = [
    "train.resolutions=[{fraction: 0.5, until: 7}]",
    "train.coarsest_px=1",
    "train.iterations=14",
    "train.checkpoint_every=1",
]


@pytest.mark.parametrize("killed_after", [1, 3, 6, 7, 8, 12])
def test_a_killed_run_resumes_to_the_same_bits(capture, configure, log, tmp_path, dies_after, killed_after):
    settings = [*ON, *SMALL, *EVENTS]
    whole = train(*capture, configure(*settings), tmp_path / "whole", log).surfels_path
    with dies_after(killed_after):
        train(*capture, configure(*settings), tmp_path / "cut", log)
    resumed = train(*capture, configure(*settings, "resume=true"), tmp_path / "cut", log)
    assert resumed.surfels_path.read_bytes() == whole.read_bytes()


def test_checkpoints_hold_depths_only_where_they_will_be_asked_for(capture, configure, log, tmp_path):
    def kept(*overrides):
        train(*capture, configure(*overrides, "train.checkpoint_every=8"), tmp_path, log)
        extra = checkpoint.latest(tmp_path, log).extra
        return {name: value.shape for name, value in extra.items() if name.startswith("multiview/")}

    assert kept() == {}
    assert kept(*ON, *SMALL) == {**{f"multiview/{view}": (12, 16) for view in range(4)}, "multiview/fraction": ()}
    # an epoch has 4 iterations: none of these 8 comes within one of the start
    late = [change.replace("start=2", "start=13") for change in ON]
    assert kept(*late, *SMALL) == {}


def test_pairs_come_in_their_iterations_and_are_drawn_by_seed_and_iteration(capture, configure):
    scene = capture[0]
    views = filled(scene, configure(*ON, *SMALL, "loss.multiview_geometric.end=9", "loss.multiview_photometric.end=7"))
    assert [views.pair(i, 0) is not None for i in (1, 2, 8, 9)] == [False, True, True, False]
    drawn = [views.pair(i, 0) for i in range(2, 9)]
    assert len({pair.neighbour.name for pair in drawn}) > 1 and len({pair.seed for pair in drawn}) == 7
    assert all(pair.neighbour.name != scene.train[0].name for pair in drawn)
    again = filled(scene, configure(*ON, *SMALL)).pair(5, 0)
    assert (again.neighbour.name, again.seed) == (views.pair(5, 0).neighbour.name, views.pair(5, 0).seed)
    assert filled(scene, configure(*ON, *SMALL, "train.seed=1")).pair(5, 0).seed != again.seed


def test_a_neighbour_has_been_rendered_at_this_size(capture, configure):
    config = configure(*ON, *SMALL, "train.resolutions=[{fraction: 0.5, until: 6}]", "train.coarsest_px=1")
    views = NeighbourViews(Views(capture[0].train), config)
    assert views.pair(3, 0) is None
    views.keep(3, 2, torch.full((12, 16), 1.5), torch.ones(12, 16))
    pair = views.pair(4, 0)
    assert pair.neighbour.name == capture[0].train[2].name and pair.neighbour_photo.grey.shape == (12, 16)
    assert pair.photo.textured.shape == (12, 16)
    assert views.pair(4, 2) is None
    assert views.pair(6, 0) is None


def test_a_neighbour_comes_without_its_priors_and_is_else_the_same(capture, configure):
    scene = capture[0]
    ones = np.ones((24, 32), np.float32)
    views = Views(scene.train, {frame.name: ViewMaps(depth=ones, depth_confidence=ones) for frame in scene.train})
    whole, bare = views.at(1), views.at(1, priors=False)
    assert whole.maps.depth is not None and bare.maps == ViewMaps()
    assert torch.equal(whole.image, bare.image) and torch.equal(whole.K, bare.K)
    pairs = NeighbourViews(views, configure(*ON, *SMALL))
    for index in range(len(scene.train)):
        pairs.keep(4, index, torch.full((24, 32), 1.5), torch.ones(24, 32))
    assert pairs.pair(5, 0).neighbour.maps == ViewMaps()


def test_cameras_that_only_turn_train_without(capture, configure, log, tmp_path):
    scene, points = capture

    def at_one_place(frame):
        pose = scene.train[0].camera.cam_from_world
        return dataclasses.replace(frame, camera=Camera(frame.camera.K, 32, 24, pose))

    turned = dataclasses.replace(scene, train=tuple(at_one_place(frame) for frame in scene.train))
    losses = train(turned, points, configure(*ON, *SMALL), tmp_path, log).losses
    assert losses.keys() == {"rgb", "normal_consistency", "loss", "psnr_db"}


def test_normals_are_rendered_for_the_photometric_term_alone(capture, configure):
    def wanted(*overrides):
        config = configure(*overrides, "loss.normal_consistency.enabled=false")
        return needed_maps(Views(capture[0].train).at(0), config, 5, filled(capture[0], config).pair(5, 0))

    assert wanted(*ON[2:])["with_normal"]
    assert not wanted(*ON[:2])["with_normal"]
    assert not wanted()["with_normal"]


def test_gradients_reach_depth_and_normal_of_the_drawn_pixels_and_nothing_else(capture, configure):
    config = configure(*ON, *SMALL)
    pair, view = filled(capture[0], config).pair(5, 0), Views(capture[0].train).at(0)
    depth = torch.full((24, 32), 1.53, requires_grad=True)
    normal = torch.tensor([0.2, 0.0, -0.9]).expand(24, 32, 3).clone().requires_grad_()
    maps = Rendering(None, torch.ones(24, 32), depth, None, normal, None)
    drawn = torch.zeros(24, 32, dtype=torch.bool)
    column, row = drawn_pixels(maps, pair, 100)
    drawn[row, column] = True
    gradients = {}
    for names in (["multiview_geometric"], ["multiview_photometric"], ["multiview_geometric", "multiview_photometric"]):
        terms = multiview_terms(maps, view, pair, config.loss.multiview, names)
        assert list(terms) == names
        total = sum(weight * term for weight, term in zip((2.0, 3.0), terms.values(), strict=False))
        wanted = {"allow_unused": True, "materialize_grads": True}
        gradients[len(gradients)] = torch.autograd.grad(total, [depth, normal], **wanted)
    geometric, photometric, both = gradients.values()
    assert (geometric[0] != 0).any() and (geometric[1] == 0).all()
    assert (photometric[0] != 0).any() and (photometric[1] != 0).any()
    for i in range(2):
        torch.testing.assert_close(both[i], geometric[i] + 1.5 * photometric[i])
        assert torch.isfinite(both[i]).all() and (both[i][~drawn] == 0).all()


def test_pixels_are_drawn_where_there_is_something_to_compare(capture, configure):
    pair = filled(capture[0], configure(*ON, *SMALL)).pair(5, 0)
    textured = torch.zeros(24, 32, dtype=torch.bool)
    textured[4:20, 6:26] = True
    pair = pair._replace(photo=pair.photo._replace(textured=textured))
    alpha, depth = torch.ones(24, 32), torch.full((24, 32), 1.5)
    alpha[:, 10] = 0.49
    depth[7] = 0

    maps = Rendering(None, alpha, depth, None, None, None)
    column, row = drawn_pixels(maps, pair, 100)
    assert len(column) == 100
    good = textured & (alpha >= 0.5) & (depth > 0)
    assert good[row, column].all()
    assert np.ptp(column.numpy()) > 15 and np.ptp(row.numpy()) > 12
    again = drawn_pixels(maps, pair, 100)
    assert torch.equal(column, again[0]) and torch.equal(row, again[1])
    alpha[:] = 0
    assert len(drawn_pixels(maps, pair, 100)[0]) == 0


def test_nothing_to_compare_is_no_loss(capture, configure, log, tmp_path):
    losses = train(*capture, configure(*ON, *SMALL, "loss.multiview.min_std=0.5"), tmp_path, log).losses
    assert losses["multiview_photometric"] == 0 and losses["multiview_geometric"] == 0


def test_shares_of_a_run_forbid_to_prolong_it(capture, configure, log, tmp_path):
    shares = [change.replace("start=2", "start=0.25") for change in ON] + SMALL
    train(*capture, configure(*shares), tmp_path, log)
    with pytest.raises(InputError, match=r"train\.iterations"):
        train(*capture, configure(*shares, "train.iterations=10", "resume=true"), tmp_path, log)
    assert train(*capture, configure(*shares, "resume=true"), tmp_path, log).iterations == 8
