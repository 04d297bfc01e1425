"""Whole runs with densification and pruning."""

import re

import numpy as np
import pytest
import torch

from room2dgs import splat
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.train import checkpoint, load_surfels, train
from room2dgs.train.progress import StageClock
from room2dgs.train.step import forward_backward

SEEDS = ["strategy=seeds", "seeds.voxel_m=0.05", "strategy.thin=0"]
PLAIN = [
    "strategy=plain",
    "seeds.init=points",
    "seeds.per_seed=1",
    "strategy.reset_every=4",
    "strategy.prune_opacity=0.005",
]
LENIENT = ["strategy.prune_opacity=0.005", "strategy.prune_size=9"]  # a reset kills nothing
AMPLE = "strategy.max_surfels=5000"  # for these few pixels
OFTEN = ["train.iterations=12", "train.checkpoint_every=1", "strategy.every=3", "strategy.start=0", "strategy.stop=10"]
EAGER = ["strategy.grow_gradient=1e-6", "strategy.min_visits=1"]
KINDS = {
    "seeds": [*SEEDS, *OFTEN, *EAGER, "strategy.random_survival=true"],
    "plain": [*PLAIN, *OFTEN, "strategy.grow_gradient=1e-5", "strategy.split_size=0.2", *LENIENT, AMPLE],
}


def adjustments(log):
    """Iteration -> what the log says of it."""
    found = [re.match(r"iteration (\d+)/\d+: (.*); (\d+) seeds$", line) for line in log.lines]
    return {int(match[1]): (match[2], int(match[3])) for match in found if match}


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_killed_between_and_at_adjustments_resumes_to_the_same_bits(
    capture, configure, log, tmp_path, dies_after, kind
):
    settings = KINDS[kind]
    whole = train(*capture, configure(*settings), tmp_path / "whole", log)
    found = adjustments(log)
    assert {3, 6, 9} <= set(found) and all(iteration <= 9 for iteration in found)
    assert len({count for _, count in found.values()}) > 1 and whole.seeds == found[9][1]
    for killed_after in (2, 3, 8):
        out = tmp_path / str(killed_after)
        with dies_after(killed_after):
            train(*capture, configure(*settings), out, log)
        resumed = train(*capture, configure(*settings, "resume=true"), out, log)
        assert resumed.surfels_path.read_bytes() == whole.surfels_path.read_bytes()
        ends = [checkpoint.latest(folder, log) for folder in (tmp_path / "whole", out)]
        for part in ("adam", "extra"):
            mine, theirs = getattr(ends[0], part), getattr(ends[1], part)
            assert mine.keys() == theirs.keys() and all(torch.equal(mine[key], theirs[key]) for key in mine)


@pytest.mark.parametrize("kind", KINDS)
def test_added_and_pruned_seeds_are_the_same_on_any_number_of_threads(capture, configure, log, tmp_path, kind):
    before = torch.get_num_threads()
    files = []
    try:
        for threads in (1, 3):
            torch.set_num_threads(threads)
            splat.set_threads(threads)
            files.append(train(*capture, configure(*KINDS[kind]), tmp_path / str(threads), log).surfels_path)
    finally:
        torch.set_num_threads(before)
        splat.set_threads(1)
    assert files[0].read_bytes() == files[1].read_bytes()
    other = train(*capture, configure(*KINDS[kind], "train.seed=3"), tmp_path / "other", log)
    assert other.surfels_path.read_bytes() != files[0].read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_cap_is_never_exceeded_and_reached(capture, configure, log, tmp_path, kind):
    free = train(*capture, configure(*KINDS[kind], "strategy.prune_opacity=0"), tmp_path / "free", log)
    before = int(log.lines[0].split(" surfels")[0].split()[-1])
    cap = (before + free.surfels) // 2
    log.lines.clear()
    settings = [*KINDS[kind], "strategy.prune_opacity=0", f"strategy.max_surfels={cap}"]
    capped = train(*capture, configure(*settings), tmp_path / "capped", log)
    assert before < cap < free.surfels
    assert cap - 2 < capped.surfels <= cap


def test_without_a_cause_nothing_is_added_and_watching_changes_no_bit(capture, configure, log, tmp_path):
    fixed = train(*capture, configure("seeds.voxel_m=0.05", *OFTEN, "strategy=fixed"), tmp_path / "fixed", log)
    settings = [*SEEDS, *OFTEN, "strategy.grow_gradient=1e6", "strategy.prune_opacity=0", "strategy.stop=7"]
    watched = train(*capture, configure(*settings), tmp_path / "watched", log)
    assert watched.seeds == fixed.seeds
    pairs = zip(load_surfels(fixed.surfels_path), load_surfels(watched.surfels_path), strict=True)
    assert all(torch.equal(a, b) for a, b in pairs)
    assert adjustments(log)[3] == ("nothing added, nothing pruned", fixed.seeds)


def test_what_no_view_sees_goes_after_two_epochs(capture, configure, log, tmp_path):
    scene, points = capture
    behind = np.array([[0.03, 0.0, -4.0], [0.33, 0.0, -4.0], [0.63, 0.0, -4.0]])  # of all cameras
    xyz = np.concatenate([points.xyz, behind])
    rgb = np.concatenate([points.rgb, np.full((3, 3), 99, np.uint8)])
    more = PointCloud(xyz, rgb)
    settings = [*SEEDS, *OFTEN, "strategy.every=4", "strategy.stop=12", "strategy.grow_gradient=1e6"]
    result = train(scene, more, configure(*settings), tmp_path, log)
    found = adjustments(log)  # four training views
    assert (
        found[4][0] == "nothing added, nothing pruned"
        and found[8][0].startswith("pruned ")
        and "(unseen)" in found[8][0]
    )
    centres = load_surfels(result.surfels_path).centers
    assert (centres[:, 2] > -3).all()


def test_faint_seeds_go_and_one_at_least_stays(capture, configure, log, tmp_path):
    settings = [*SEEDS, *OFTEN, "strategy.grow_gradient=1e6", "seeds.opacity=0.3"]
    kept = train(*capture, configure(*settings), tmp_path / "kept", log)
    assert kept.seeds == adjustments(log)[3][1]
    gone = train(*capture, configure(*settings, "strategy.prune_opacity=1"), tmp_path / "gone", log)
    assert gone.surfels > 0  # with nothing left to learn the run would end in an error


def test_opacities_come_down_at_a_reset_and_carry_no_momentum(capture, configure, log, tmp_path):
    settings = [*PLAIN, *OFTEN, "strategy.grow_gradient=1e6", "strategy.prune_opacity=0", "train.iterations=4"]
    result = train(*capture, configure(*settings, "strategy.every=2"), tmp_path, log)
    assert adjustments(log)[4][0] == "opacities reset"
    assert load_surfels(result.surfels_path).opacities.max() < 0.0101
    state = checkpoint.latest(tmp_path, log)
    assert (state.adam["exp_avg/opacity_logits"] == 0).all() and state.adam["step/opacity_logits"] == 4
    assert (state.adam["exp_avg/offsets"] != 0).any()


def test_growth_goes_to_tensorboard(capture, configure, log, tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    train(*capture, configure(*KINDS["seeds"], "train.tensorboard=true"), tmp_path, log)
    events = EventAccumulator(str(tmp_path / "tensorboard"))
    events.Reload()
    tags = set(events.Tags()["scalars"])
    assert {"seeds/count", "seeds/added 80 cm", "seeds/added 5 cm", "seeds/pruned transparent"} <= tags
    assert [event.step for event in events.Scalars("seeds/count")] == [3, 6, 9]


def test_gradients_of_a_step_are_noted_only_when_asked_for(capture, configure):
    from room2dgs.train.model import new_model
    from room2dgs.train.views import Views

    scene, points = capture
    config = configure()
    view = Views(scene.train).at(0)
    steps = [
        forward_backward(new_model(scene, points, config), view, config, StageClock(), screen_gradients=asked)
        for asked in (False, True)
    ]
    assert steps[0].center_gradients is None and steps[0].opacities is None
    assert steps[1].center_gradients.shape == (len(steps[1].opacities), 2)
    assert steps[1].center_gradients.abs().sum() > 0
    torch.testing.assert_close(steps[1].opacities, torch.full_like(steps[1].opacities, config.seeds.opacity))
