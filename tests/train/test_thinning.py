"""Surfels that hardly show go once growth has ended."""

import re

import pytest
import torch

from room2dgs import splat
from room2dgs.geometry.camera_tensors import view_matrices
from room2dgs.splat.contribution import contributions
from room2dgs.train import load_surfels, train

SETTINGS = [
    "strategy=seeds",
    "seeds.voxel_m=0.05",
    "train.iterations=12",
    "train.checkpoint_every=1",
    "strategy.every=3",
    "strategy.start=0",
    "strategy.stop=0.5",
    "strategy.grow_gradient=1e6",
    "strategy.prune_opacity=0",
    "train.resolutions=[]",
]
DECODERS = ["seeds.decoder=explicit", "seeds.decoder=shared"]


def told(log):
    """(left, before) of each line that tells of thinning."""
    found = [re.match(r"iteration 6: ([\d,]+) of ([\d,]+) surfels", line) for line in log.lines]
    return [tuple(int(text.replace(",", "")) for text in match.groups()) for match in found if match]


@pytest.mark.parametrize("decoder", DECODERS)
def test_what_is_left_is_what_held_the_rest_of_the_pictures(capture, configure, log, tmp_path, decoder):
    scene, _ = capture
    half = [*SETTINGS, decoder, "render.sh_degree=0", "train.iterations=6", "strategy.stop=1.0"]
    before = train(*capture, configure(*half, "strategy.thin=0"), tmp_path / "before", log)
    after = train(*capture, configure(*half, "strategy.thin=0.2"), tmp_path / "after", log)
    assert told(log) == [(after.surfels, before.surfels)] and after.surfels < before.surfels
    views = [(*view_matrices(frame.camera), *frame.camera.size) for frame in scene.train]
    whole, left = load_surfels(before.surfels_path), load_surfels(after.surfels_path)
    kept = torch.tensor([bool((whole.centers == centre).all(dim=1).any()) for centre in left.centers])
    assert kept.all()  # nothing has moved
    needed = contributions(whole, views, 0.05)
    gone = torch.tensor([not bool((left.centers == centre).all(dim=1).any()) for centre in whole.centers])
    assert 0.1 < float(needed[gone].sum() / needed.sum()) <= 0.2
    if "explicit" in decoder:
        assert needed[gone].max() <= needed[~gone].min()
    else:  # whole seeds
        assert (gone.view(before.seeds, -1).all(dim=1) == gone.view(before.seeds, -1).any(dim=1)).all()


@pytest.mark.parametrize("decoder", DECODERS)
def test_a_run_killed_around_it_resumes_to_the_same_bits_on_any_number_of_threads(
    capture, configure, log, tmp_path, dies_after, decoder
):
    settings = [*SETTINGS, decoder, "render.sh_degree=0", "strategy.thin=0.1"]
    whole = train(*capture, configure(*settings), tmp_path / "whole", log)
    threads = torch.get_num_threads()
    for killed_after in (5, 6, 7):
        out = tmp_path / str(killed_after)
        with dies_after(killed_after):
            train(*capture, configure(*settings), out, log)
        try:
            torch.set_num_threads(3)
            splat.set_threads(3)
            resumed = train(*capture, configure(*settings, "resume=true"), out, log)
        finally:
            torch.set_num_threads(threads)
            splat.set_threads(1)
        assert resumed.surfels_path.read_bytes() == whole.surfels_path.read_bytes()
    assert whole.surfels < told(log)[0][1]


def test_without_it_all_stay(capture, configure, log, tmp_path):
    train(*capture, configure(*SETTINGS, "strategy.thin=0"), tmp_path, log)
    assert not told(log)
