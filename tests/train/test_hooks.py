"""What a hook of one's own can do in a run."""

import pytest
import torch

from room2dgs.errors import InputError
from room2dgs.train import Hook, checkpoint, load_surfels, train


class Recorder(Hook):
    """Notes every call; fails at an iteration if asked to."""

    def __init__(self, fails_at=None):
        self.calls, self.fails_at = [], fails_at

    def on_start(self, trainer):
        self.calls.append("start")

    def load(self, trainer, state):
        self.calls.append("load")

    def before_iteration(self, trainer, iteration):
        self.calls.append(f"before {iteration.number}")
        assert not hasattr(iteration, "step") and trainer.model.iteration == iteration.number

    def after_backward(self, trainer, iteration):
        gradients = [value.grad for value in trainer.model.decoder.parameters().values()]
        assert all(gradient is not None for gradient in gradients) and trainer.model.iteration == iteration.number
        if iteration.number == self.fails_at:
            raise KeyboardInterrupt

    def after_step(self, trainer, iteration):
        self.calls.append(f"after {iteration.done}")
        assert trainer.model.iteration == iteration.done and iteration.step.losses["loss"] > 0

    def on_end(self, trainer):
        self.calls.append("end")


class Countdown(Hook):
    """Ends a run `left` iterations after it began, however often it was interrupted."""

    def __init__(self, left):
        self.left = left

    def after_step(self, trainer, iteration):
        self.left -= 1
        trainer.stop_requested = self.left == 0

    def state(self):
        return {"left": torch.tensor(self.left)}

    def load(self, trainer, state):
        self.left = int(state["left"])


def bits(result):
    return [values.numpy().tobytes() for values in load_surfels(result.surfels_path)]


def test_a_hook_is_called_around_every_iteration_and_changes_no_bit(capture, configure, log, tmp_path):
    recorder = Recorder()
    result = train(*capture, configure(), tmp_path / "with", log, hooks=[recorder])
    steps = [call for number in range(8) for call in (f"before {number}", f"after {number + 1}")]
    assert recorder.calls == ["start", *steps, "end"]
    assert bits(result) == bits(train(*capture, configure(), tmp_path / "without", log))


def test_hooks_see_the_end_of_a_run_that_breaks_off(capture, configure, log, tmp_path):
    failing, beside = Recorder(fails_at=2), Countdown(100)
    with pytest.raises(KeyboardInterrupt):
        train(*capture, configure(), tmp_path, log, hooks=[failing, beside])
    assert failing.calls[-2:] == ["before 2", "end"]


def test_a_hook_that_cannot_start_is_not_ended_and_its_error_is_what_is_told(capture, configure, log, tmp_path):
    class Unready(Hook):
        def on_start(self, trainer):
            raise InputError("no port is free")

        def on_end(self, trainer):
            self.server.stop()  # which there is not

    before, after = Recorder(), Countdown(5)
    with pytest.raises(InputError, match="no port is free"):
        train(*capture, configure(), tmp_path, log, hooks=[before, Unready(), after])
    assert before.calls == ["start", "end"]


def test_a_hook_can_end_a_run_which_leaves_a_checkpoint_and_a_result(capture, configure, log, tmp_path):
    late = ["train.checkpoint_every=40", "train.test_every=40", "train.log_every=40"]
    result = train(*capture, configure("train.iterations=50", *late), tmp_path, log, hooks=[Countdown(5)])
    assert result.iterations == 5 and result.surfels_path.is_file()
    assert result.losses["psnr_db"] > 0 and result.test_psnr_db > 0
    assert [path.name for path in checkpoint.on_disk(tmp_path)] == ["iteration_0000005.safetensors"]


def test_a_hooks_state_is_in_the_checkpoint_and_comes_back(capture, configure, log, tmp_path):
    settings = ["train.iterations=50", "train.checkpoint_every=1"]
    with pytest.raises(KeyboardInterrupt):
        train(*capture, configure(*settings), tmp_path, log, hooks=[Countdown(6), Recorder(fails_at=4)])
    assert checkpoint.latest(tmp_path, log).extra["Countdown/left"] == 2
    recorder = Recorder()
    result = train(*capture, configure(*settings, "resume=true"), tmp_path, log, hooks=[Countdown(99), recorder])
    assert result.iterations == 6
    assert "load" not in recorder.calls  # it had no state
    whole = train(*capture, configure("train.iterations=50"), tmp_path / "whole", log, hooks=[Countdown(6)])
    assert bits(whole) == bits(result)


def test_hooks_of_one_name_are_refused(capture, configure, log, tmp_path):
    with pytest.raises(ValueError, match="Countdown"):
        train(*capture, configure(), tmp_path, log, hooks=[Countdown(1), Countdown(2)])


def test_a_hook_can_replace_the_view_and_gets_the_gradient_of_its_pose(capture, configure, log, tmp_path):
    class Poses(Hook):
        gradients = ()

        def before_iteration(self, trainer, iteration):
            self.pose = iteration.view.cam_from_world.clone().requires_grad_()
            iteration.view = iteration.view._replace(cam_from_world=self.pose)

        def after_backward(self, trainer, iteration):
            self.gradients += (self.pose.grad,)

    poses = Poses()
    train(*capture, configure(), tmp_path, log, hooks=[poses])
    assert len(poses.gradients) == 8
    assert all(torch.isfinite(g).all() and g[:3, 3].abs().max() > 1e-6 for g in poses.gradients)
