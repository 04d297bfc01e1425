"""Poses that are a little off are corrected in training; the world stays where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from room2dgs.captures.scene import Scene
from room2dgs.errors import InputError
from room2dgs.geometry.poses import pose_at
from room2dgs.splat import set_threads
from room2dgs.train import Hook, checkpoint, load_surfels, train
from room2dgs.train.corrections import corrected, without_world_motion
from room2dgs.train.per_view_adam import PerViewAdam
from room2dgs.train.schedule import correction_share
from room2dgs.train.views import Views

POSES = "train.refine_poses=true"


class Stop(Hook):
    """Breaks a run off."""

    def __init__(self, at: int) -> None:
        self.at = at

    def after_backward(self, trainer, iteration):
        if iteration.number == self.at:
            raise KeyboardInterrupt


def bits(result) -> list[bytes]:
    return [values.numpy().tobytes() for values in load_surfels(result.surfels_path)]


def learnt(out, log, name: str) -> np.ndarray:
    return checkpoint.latest(out, log).extra[f"{name}/values"].numpy()


def test_a_correction_turns_the_camera_about_its_centre_and_shifts_it(capture):
    view = Views(capture[0].train).at(1)
    turn, shift = np.array([0.02, -0.05, 0.03]), np.array([0.1, 0.2, -0.3])
    given = capture[0].train[1].camera
    pose = corrected(view, torch.from_numpy(np.concatenate([turn, shift]))).cam_from_world.numpy()
    want = pose_at(given.rotation @ Rotation.from_rotvec(turn).as_matrix().T, given.centre + shift)
    np.testing.assert_allclose(pose, want, atol=1e-6)
    same = corrected(view, torch.zeros(6, dtype=torch.float64)).cam_from_world
    assert torch.equal(same, view.cam_from_world)


def test_gradients_of_a_correction_are_those_of_finite_differences(capture):
    view = Views(capture[0].train).at(0)
    view = view._replace(cam_from_world=view.cam_from_world.double())
    start = torch.tensor([0.01, 0.02, -0.03, 0.1, 0.0, 0.2], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda row: corrected(view, row).cam_from_world, start)


def test_anchoring_takes_out_what_moves_the_world():
    random = np.random.default_rng(0)
    centre = random.normal(size=(7, 3))
    from_mean = torch.from_numpy(centre - centre.mean(axis=0))
    world = torch.cat([torch.tensor([[0.1, 0.2, 0.3]] * 7), 0.5 + 0.1 * from_mean], dim=1).double()
    assert without_world_motion(world, from_mean).abs().max() < 1e-12
    own = without_world_motion(torch.from_numpy(random.normal(size=(7, 6))), from_mean)
    assert own.mean(dim=0).abs().max() < 1e-12 and abs((own[:, 3:] * from_mean).sum()) < 1e-12
    torch.testing.assert_close(without_world_motion(own + world, from_mean), own)
    nowhere = torch.zeros(7, 3, dtype=torch.float64)
    torch.testing.assert_close(without_world_motion(own, nowhere), own)  # cameras that only turn


def test_a_row_moves_by_its_own_gradients_alone():
    rows, rates = PerViewAdam(3, 2), torch.tensor([0.1, 0.01], dtype=torch.float64)
    for _ in range(3):
        rows.step(1, torch.tensor([5.0, -1e-7], dtype=torch.float64), rates)
    np.testing.assert_allclose(rows.values.numpy(), [[0, 0], [-0.3, 0.03], [0, 0]], rtol=1e-6)
    other = PerViewAdam(3, 2)
    other.load({name: value.clone() for name, value in rows.state().items()})
    for one in (rows, other):
        one.step(2, torch.tensor([1.0, 2.0], dtype=torch.float64), rates)
        one.step(1, torch.tensor([-1.0, 2.0], dtype=torch.float64), rates)
    assert torch.equal(rows.values, other.values)


def test_rates_are_zero_at_first_and_fall():
    assert [correction_share(number, 100) for number in (0, 9, 10)] == [0.0, 0.0, 1.0]
    assert correction_share(99, 100) == pytest.approx(0.01)


def shaken(scene: Scene, metres: float) -> tuple[Scene, np.ndarray]:
    """Cameras moved sideways, one by one, not all of them together."""
    shift = np.random.default_rng(3).normal(size=(len(scene.train), 3)) * [metres, metres, 0]
    shift -= shift.mean(axis=0)
    frames = [
        replace(
            frame,
            camera=replace(frame.camera, cam_from_world=pose_at(frame.camera.rotation, frame.camera.centre + offset)),
        )
        for frame, offset in zip(scene.train, shift, strict=True)
    ]
    return replace(scene, train=tuple(frames)), shift


def test_shifted_cameras_go_back(capture, configure, log, tmp_path):
    scene, shift = shaken(capture[0], 0.01)
    rates = ["train.rates.pose_center=3e-3", "train.rates.pose_rotation=0"]
    settings = ["train.iterations=400", "train.checkpoint_every=400", "train.log_every=400", POSES, *rates]
    train(scene, capture[1], configure(*settings), tmp_path, log)
    rows = learnt(tmp_path, log, "pose_corrections")
    centre = np.stack([frame.camera.centre for frame in scene.train])
    errors = torch.from_numpy(np.concatenate([np.zeros_like(shift), shift], axis=1))
    there = without_world_motion(errors, torch.from_numpy(centre - centre.mean(axis=0))).numpy()[:, 3:5]
    assert np.linalg.norm(rows[:, 3:5] + there) < 0.3 * np.linalg.norm(there)
    assert np.abs(rows.mean(axis=0)).max() < 1e-12
    assert any(line.startswith("pose corrections: ") for line in log.lines)


@pytest.mark.parametrize("threads", [1, 2])
def test_bits_are_the_same_on_any_threads_and_after_a_resume(capture, configure, log, tmp_path, threads):
    settings = [
        "train.iterations=24",
        "train.checkpoint_every=1",
        "loss.multiview_photometric.enabled=true",
        "loss.multiview_photometric.start=4",
        "loss.multiview_photometric.ramp=0",
        POSES,
    ]
    try:
        set_threads(threads)
        whole = train(*capture, configure(*settings), tmp_path / "whole", log)
        with pytest.raises(KeyboardInterrupt):
            train(*capture, configure(*settings), tmp_path / "cut", log, hooks=[Stop(13)])
        set_threads(3 - threads)
        resumed = train(*capture, configure(*settings, "resume=true"), tmp_path / "cut", log)
    finally:
        set_threads(None)
    assert bits(whole) == bits(resumed)
    first, second = (learnt(tmp_path / out, log, "pose_corrections") for out in ("whole", "cut"))
    assert first.tobytes() == second.tobytes() and np.abs(first).max() > 0


@pytest.mark.parametrize("key", ["train.refine_poses", "train.rates.pose_center"])
def test_a_run_resumes_only_with_the_same_corrections(capture, configure, log, tmp_path, key):
    train(*capture, configure(POSES), tmp_path, log)
    other = {"train.refine_poses": "false", "train.rates.pose_center": "1e-5"}[key]
    with pytest.raises(InputError, match=f"was trained with {key}="):
        train(*capture, configure(POSES, f"{key}={other}", "resume=true"), tmp_path, log)
