"""Nothing in a run becomes NaN, whatever the surfels; what would, ends it with the name of the term and the frame."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch

from room2dgs.train import Hook, load_surfels, train
from room2dgs.train.objective import known_terms

CAMERA_Z_M = -1.5  # the cameras look along z from there


class HardSurfels(Hook):
    """Puts hard surfels among the others, and sees that everything stays finite."""

    def on_start(self, trainer):
        d = SimpleNamespace(**trainer.model.decoder.parameters())
        with torch.no_grad():
            d.rotations[0] = 0
            d.rotations[1] *= 1e-20
            d.rotations[2] = torch.tensor([0.7071, 0.7071, 0, 0])  # edge-on
            d.raw_scales[3] = torch.tensor([2.3, -11.5])  # a needle, 10 m long
            d.raw_scales[4] = -11.5
            d.raw_scales[5] = 2.3  # across the cameras
            d.opacity_logits[6:9] = 12
            d.opacity_logits[9] = -12
            d.opacity_logits[10] = -5.5373  # at the floor of 1/255
            d.offsets[11, :, 2] += CAMERA_Z_M  # in the cameras' plane
            d.offsets[12, :, 2] += CAMERA_Z_M + 0.05  # in the near plane
            d.offsets[13, :, 2] += 100
            d.offsets[14] = 0  # in one place
            d.offsets[15] += 1e4
            d.sh_dc[16] = -50.0

    def after_step(self, trainer, iteration):
        assert all(map(math.isfinite, iteration.step.losses.values())), iteration.step.losses
        for name, value in trainer.model.decoder.parameters().items():
            assert torch.isfinite(value).all() and torch.isfinite(value.grad).all(), name


def test_a_run_with_hard_surfels_shows_no_nan(capture, configure, log, tmp_path):
    settings = [
        "train.iterations=12", "loss.normal_consistency.start=0", "loss.distortion.enabled=true",
        "loss.distortion.weight=1", "loss.distortion.start=0", "loss.multiview_photometric.enabled=true",
        "loss.multiview_photometric.start=0", "loss.multiview_geometric.enabled=true",
        "loss.multiview_geometric.start=0",
    ]  # fmt: skip
    result = train(*capture, configure(*settings), tmp_path, log, hooks=[HardSurfels()])
    assert result.iterations == 12
    assert all(torch.isfinite(values).all() for values in load_surfels(result.surfels_path))


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        (lambda rendering, *_: rendering.depth.sum() * float("nan"), "loss distortion = nan, loss = nan is not finite"),
        # finite itself, but with an infinite slope
        (
            lambda rendering, *_: (0 * rendering.depth.sum()).sqrt(),
            "gradient of offsets, rotations, raw_scales, opacity_logits is not finite, from distortion",
        ),
    ],
)
def test_a_run_that_would_diverge_stops_with_term_and_frame(
    capture, configure, log, tmp_path, monkeypatch, value, sentence
):
    def later(rendering, view, context):
        good = rendering.distortion.mean()
        return value(rendering) if context.iteration >= 2 else good

    monkeypatch.setitem(known_terms(), "distortion", replace(known_terms()["distortion"], value=later))
    distortion = ["loss.distortion.enabled=true", "loss.distortion.weight=1", "loss.distortion.start=0"]
    with pytest.raises(RuntimeError, match=sentence) as stopped:
        train(*capture, configure(*distortion), tmp_path, log)
    frames = [frame.name for frame in capture[0].train]
    assert str(stopped.value).startswith("iteration 2, view ")
    assert any(f"view {name}:" in str(stopped.value) for name in frames)
