import pytest
import torch

from room2dgs.train import checkpoint, train

KINDS = [("shared", "exp"), ("shared", "softplus"), ("explicit", "softplus")]


@pytest.mark.parametrize(("kind", "activation"), KINDS)
def test_loss_falls_and_a_killed_run_resumes_to_the_same_bits(
    capture, configure, log, tmp_path, dies_after, kind, activation
):
    settings = [f"seeds.decoder={kind}", f"seeds.scale_activation={activation}", "train.iterations=100"]
    settings += ["train.checkpoint_every=25", "train.log_every=10"]
    whole = train(*capture, configure(*settings), tmp_path / "whole", log).surfels_path
    losses = [float(line.split("loss ")[1].split()[0]) for line in log.lines if ": loss" in line]
    assert losses[-1] < 0.6 * losses[0]
    with dies_after(25):
        train(*capture, configure(*settings), tmp_path / "cut", log)
    resumed = train(*capture, configure(*settings, "resume=true"), tmp_path / "cut", log)
    assert resumed.surfels_path.read_bytes() == whole.read_bytes()
    ends = [checkpoint.latest(tmp_path / name, log.lines.append) for name in ("whole", "cut")]
    for part in ("parameters", "fixed", "adam"):
        mine, theirs = (getattr(end, part) for end in ends)
        assert mine.keys() == theirs.keys()
        assert all(torch.equal(mine[name], theirs[name]) for name in mine)
