import json

import numpy as np
import pytest
import torch

from room2dgs import splat
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.errors import InputError
from room2dgs.seeds.decoders.explicit import ExplicitDecoder
from room2dgs.splat import Surfels
from room2dgs.train import checkpoint, load_surfels, train
from room2dgs.train.checkpoint import folder_of
from room2dgs.train.objective import known_terms
from room2dgs.train.surfel_file import surfels_meta
from room2dgs.train.terms.term import LossTerm


def same_bits(a: Surfels, b: Surfels) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def test_loss_falls_and_the_held_out_view_improves(capture, configure, log, tmp_path):
    config = configure("train.iterations=120", "train.log_every=10", "train.test_every=1")
    result = train(*capture, config, tmp_path, log)
    losses = [float(line.split("loss ")[1].split()[0]) for line in log.lines if ": loss" in line]
    psnr = [float(line.split("PSNR ")[1].split()[0]) for line in log.lines if "held-out" in line]
    assert losses[-1] < 0.6 * losses[0]
    assert psnr[-1] > psnr[0] + 4.0
    assert result.test_psnr_db == pytest.approx(psnr[-1], abs=0.01)
    assert result.losses.keys() == {"rgb", "normal_consistency", "loss", "psnr_db"}
    assert (result.surfels, result.iterations) == (2 * result.seeds, 120)
    assert all(result.seconds[stage] > 0 for stage in ("data", "render", "loss", "backward", "optimiser"))


def test_total_is_the_weighted_sum_of_the_logged_terms(capture, configure, log, tmp_path):
    weights = ["loss.normal_consistency.weight=0.25", "loss.normal_consistency.start=0"]
    distortion = ["loss.distortion.enabled=true", "loss.distortion.weight=3.0", "loss.distortion.start=0"]
    losses = train(*capture, configure(*weights, *distortion), tmp_path, log).losses
    expected = losses["rgb"] + 0.25 * losses["normal_consistency"] + 3.0 * losses["distortion"]
    assert losses["loss"] == pytest.approx(expected, rel=1e-5)
    assert losses["distortion"] > 0


def test_a_fixed_seed_gives_the_same_bytes_twice(capture, configure, log, tmp_path):
    files = [train(*capture, configure(), tmp_path / name, log).surfels_path for name in ("a", "b")]
    assert files[0].read_bytes() == files[1].read_bytes()
    other = train(*capture, configure("train.seed=1"), tmp_path / "c", log).surfels_path
    assert not same_bits(load_surfels(files[0]), load_surfels(other))


def test_any_number_of_threads_gives_the_same_bytes(capture, configure, log, tmp_path, monkeypatch):
    # Torch's sigmoid rounds by the number of threads, but only a few of more than 32768 numbers, and not
    # always: equal files alone could be luck, so every decoding is also seen to run on one torch thread.
    seen = []
    splats = ExplicitDecoder.splats
    monkeypatch.setattr(ExplicitDecoder, "splats", lambda *args: seen.append(torch.get_num_threads()) or splats(*args))
    before = torch.get_num_threads()
    files = []
    try:
        for threads in (1, 2, 3):
            torch.set_num_threads(threads)
            splat.set_threads(threads)
            files.append(train(*capture, configure(), tmp_path / str(threads), log).surfels_path.read_bytes())
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
        splat.set_threads(1)
    assert files[0] == files[1] == files[2]
    assert len(seen) >= 3 * (8 + 1) and set(seen) == {1}


# across a raise of the SH degree, a change of image size, the start of a term and the end of an epoch
EVENTS = [
    "render.sh_degree=2",
    "render.sh_every=3",
    "train.resolutions=[{fraction: 0.5, until: 5}]",
    "train.coarsest_px=1",
    "train.opacity_floor={value: 0.05, until: 3}",
]


@pytest.mark.parametrize("killed_after", [1, 2, 3, 5, 7])
def test_a_killed_run_resumes_to_the_same_bits(capture, configure, log, tmp_path, dies_after, killed_after):
    settings = [*EVENTS, "train.checkpoint_every=1"]
    whole = train(*capture, configure(*settings), tmp_path / "whole", log).surfels_path
    with dies_after(killed_after):
        train(*capture, configure(*settings), tmp_path / "cut", log)
    assert not (tmp_path / "cut" / "surfels.safetensors").exists()
    resumed = train(*capture, configure(*settings, "resume=true"), tmp_path / "cut", log)
    assert resumed.surfels_path.read_bytes() == whole.read_bytes()
    assert f"resuming after iteration {killed_after} of 8" in log.lines
    ends = [checkpoint.latest(tmp_path / name, log.lines.append) for name in ("whole", "cut")]
    assert ends[0].adam.keys() == ends[1].adam.keys()
    assert all(torch.equal(ends[0].adam[key], ends[1].adam[key]) for key in ends[0].adam)


def test_resume_goes_back_past_a_damaged_checkpoint_to_the_same_bits(capture, configure, log, tmp_path):
    whole = train(*capture, configure(), tmp_path, log).surfels_path.read_bytes()
    newest = checkpoint.on_disk(tmp_path)[-1]
    newest.write_bytes(newest.read_bytes()[:-100])
    resumed = train(*capture, configure("resume=true"), tmp_path, log)
    assert any("passed over" in line and newest.name in line for line in log.lines)
    assert resumed.surfels_path.read_bytes() == whole
    assert checkpoint.load(newest).iteration == 8


@pytest.mark.parametrize(
    "change",
    [
        "train.seed=3",
        "seeds.voxel_m=0.2",
        "scene.stride=2",
        "loss.dssim=0.5",
        "render.sh_degree=1",
        "train.rates.opacity=0.01",
        "train.resolutions=[{fraction: 0.5, until: 5}]",
        "train.coarsest_px=1",
        "train.opacity_floor.until=5",
    ],
)
def test_resume_with_another_setting_names_it(capture, configure, log, tmp_path, change):
    train(*capture, configure(), tmp_path, log)
    kept = checkpoint.on_disk(tmp_path)
    key = change.split("=")[0]
    with pytest.raises(InputError, match=key.replace(".", r"\.")):
        train(*capture, configure(change, "resume=true"), tmp_path, log)
    assert checkpoint.on_disk(tmp_path) == kept


def test_a_run_from_before_a_setting_goes_on_without_it_and_is_told_what_it_had(capture, configure):
    from room2dgs.train.fingerprint import check_same, fingerprint

    old = fingerprint(configure(), capture[0])
    assert not any("opacity_floor" in key for key in old)
    new = fingerprint(configure("train.opacity_floor.until=4"), capture[0])
    with pytest.raises(InputError, match=r"trained with train\.opacity_floor\.until=0, so .*until=4 cannot resume"):
        check_same(old, new, folder_of(capture[0].path))


def test_resume_with_other_views_is_refused(capture, configure, log, tmp_path):
    scene, points = capture
    train(scene, points, configure(), tmp_path, log)
    fewer = type(scene)(scene.path, scene.train[1:], scene.test)
    with pytest.raises(InputError, match="other views"):
        train(fewer, points, configure("resume=true"), tmp_path, log)


def test_settings_that_do_not_matter_may_change(capture, configure, log, tmp_path):
    train(*capture, configure(), tmp_path, log)
    free = ["train.log_every=1", "train.keep_checkpoints=1", "mesh.voxel_m=0.05", "render.threads=1"]
    result = train(*capture, configure(*free, "train.iterations=10", "resume=true"), tmp_path, log)
    assert result.iterations == 10
    assert [path.name for path in checkpoint.on_disk(tmp_path)] == ["iteration_0000010.safetensors"]


def test_fewer_iterations_than_done_just_finishes(capture, configure, log, tmp_path):
    done = train(*capture, configure(), tmp_path, log)
    before = load_surfels(done.surfels_path)
    again = train(*capture, configure("train.iterations=3", "resume=true"), tmp_path, log)
    assert again.iterations == 8
    assert same_bits(before, load_surfels(again.surfels_path))


def test_a_fresh_run_keeps_the_old_checkpoints_until_it_has_its_own(capture, configure, log, tmp_path, monkeypatch):
    train(*capture, configure(), tmp_path, log)
    old = checkpoint.on_disk(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("room2dgs.train.trainer.descend", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            train(*capture, configure("train.seed=1"), tmp_path, log)
    assert checkpoint.on_disk(tmp_path) == old
    train(*capture, configure("train.seed=1", "train.iterations=2"), tmp_path, log)
    assert [path.name for path in checkpoint.on_disk(tmp_path)] == ["iteration_0000002.safetensors"]


def test_checkpoints_beyond_the_wanted_number_go(capture, configure, log, tmp_path):
    train(*capture, configure("train.checkpoint_every=2", "train.keep_checkpoints=2"), tmp_path, log)
    assert [path.name[10:17] for path in checkpoint.on_disk(tmp_path)] == ["0000006", "0000008"]


def test_a_loss_that_is_not_a_number_stops_the_run_and_saves_nothing_broken(
    capture, configure, log, tmp_path, monkeypatch
):
    monkeypatch.setitem(
        known_terms(),
        "normal_consistency",
        LossTerm(lambda rendering, view, context: rendering.alpha.sum() * torch.nan),
    )
    with pytest.raises(RuntimeError, match=r"iteration 6, view 00000\d: loss normal_consistency = nan"):
        train(*capture, configure("loss.normal_consistency.start=6"), tmp_path, log)
    assert not (tmp_path / "surfels.safetensors").exists()
    last = checkpoint.latest(tmp_path, log.lines.append)
    assert last.iteration == 4
    assert all(torch.isfinite(value).all() for value in last.parameters.values())


class NanGradient(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x):
        ctx.shape = x.shape
        return x.sum() * 0

    @staticmethod
    def backward(ctx, grad):
        return torch.full(ctx.shape, torch.nan)


def test_a_gradient_that_is_not_a_number_names_iteration_parameter_and_term(
    capture, configure, log, tmp_path, monkeypatch
):
    monkeypatch.setitem(
        known_terms(),
        "normal_consistency",
        LossTerm(lambda rendering, view, context: NanGradient.apply(rendering.depth)),
    )
    with pytest.raises(
        RuntimeError, match=r"iteration 5, view 00000\d: the gradient of offsets.* from normal_consistency;"
    ):
        train(*capture, configure("loss.normal_consistency.start=5"), tmp_path, log)
    assert checkpoint.latest(tmp_path, log.lines.append).iteration == 4


def test_no_points_is_an_input_error_that_leaves_nothing(capture, configure, log, tmp_path):
    nothing = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    with pytest.raises(InputError, match="no points"):
        train(capture[0], nothing, configure("train.tensorboard=true"), tmp_path / "run", log)
    assert not (tmp_path / "run").exists()


def test_result_file_says_what_made_it(capture, configure, log, tmp_path):
    result = train(*capture, configure("render.background=[0.1,0.2,0.3]"), tmp_path, log)
    meta = surfels_meta(result.surfels_path)
    assert meta["iteration"] == 8 and meta["background"] == [0.1, 0.2, 0.3]
    assert (meta["sh_degree"], meta["seeds"]) == (0, result.seeds)
    surfels = load_surfels(result.surfels_path)
    assert (surfels.scales > 0).all() and (surfels.opacities > 0).all() and (surfels.opacities < 1).all()


def test_without_a_log_lines_go_to_the_runs_log_file(capture, configure, tmp_path, capsys):
    train(*capture, configure(), tmp_path)
    written = (tmp_path / "log.txt").read_text()
    assert "iteration 8/8: loss" in written and "surfels" in written and "it/s" in written
    assert capsys.readouterr().out == written


def test_tensorboard_has_every_term(capture, configure, log, tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    train(*capture, configure("train.tensorboard=true", "train.test_every=4"), tmp_path, log)
    events = EventAccumulator(str(tmp_path / "tensorboard"))
    events.Reload()
    tags = set(events.Tags()["scalars"])
    assert {"train/rgb", "train/normal_consistency", "train/loss", "train/psnr_db", "test/psnr_db"} <= tags
    assert [event.step for event in events.Scalars("train/loss")] == [4, 8]


def test_settings_survive_json(capture, configure):
    from room2dgs.train.fingerprint import check_same, digest, fingerprint

    now = fingerprint(configure(*EVENTS), capture[0])
    read = json.loads(json.dumps(now))
    check_same(read, now, folder_of(capture[0].path))
    assert digest(read) == digest(now)
    later = fingerprint(configure(*EVENTS, "train.resolutions=[{fraction: 0.5, until: 6}]"), capture[0])
    assert digest(later) != digest(now)
    with pytest.raises(InputError, match=r"train\.resolutions=\[\{.*'until': 5.*'until': 6"):
        check_same(read, later, folder_of(capture[0].path))
