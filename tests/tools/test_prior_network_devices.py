"""Training where it is faster: reduced precision, a GPU, batches from several processes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest
import torch
from torch.nn.functional import cosine_similarity

from room2dgs.errors import InputError
from room2dgs.tools.prior_network.batches import training_batch
from room2dgs.tools.prior_network.checkpoint import load_checkpoint
from room2dgs.tools.prior_network.gradients import Work, _part_batch, part_gradients
from room2dgs.tools.prior_network.network import PriorNetwork
from room2dgs.tools.prior_network.options import TrainOptions
from room2dgs.tools.prior_network.processes import made_by_processes
from room2dgs.tools.prior_network.shards import open_shards, shard_names
from room2dgs.tools.prior_network.training import train

OPTIONS = TrainOptions(size=(64, 32), steps=2, batch=4, warmup=0, validate_every=9, save_minutes=60.0, held_out=0)


@pytest.fixture
def batch(prior_shards):
    return training_batch(open_shards(prior_shards, shard_names(prior_shards)), (64, 32), range(4), 0)


def test_gradients_in_bf16_point_where_those_in_float32_do(batch):
    """As autocast computes them on a GPU; maps and losses stay floats."""
    torch.manual_seed(0)
    network = PriorNetwork().train()
    terms, wanted = part_gradients(network, batch, "float32")
    short_terms, found = part_gradients(network, batch, "bf16")
    assert all(gradient.dtype == torch.float32 for gradient in found)
    assert short_terms != terms
    for name, value in terms.items():
        assert short_terms[name] == pytest.approx(value, rel=0.05, abs=0.02)
    one, other = (torch.cat([part.flatten() for part in gradients]) for gradients in (wanted, found))
    assert cosine_similarity(one, other, dim=0) > 0.98


def test_heads_keep_their_digits_in_bf16(batch):
    """Depth read off a bf16 number would be rounded to 0.4 %, which neighbours' differences would learn."""
    torch.manual_seed(0)
    network = PriorNetwork().eval()
    with torch.inference_mode(), torch.autocast("cpu", torch.bfloat16):
        maps = network(batch.image, batch.intrinsics)
    assert all(part.dtype == torch.float32 for part in maps)
    rounded = maps.ln_depth.to(torch.bfloat16).float()
    assert (rounded != maps.ln_depth).float().mean() > 0.9


def test_a_run_goes_on_with_another_precision(prior_shards, tmp_path):
    train(prior_shards, tmp_path / "run", replace(OPTIONS, minutes=1e-9), log=lambda line: None)
    done = load_checkpoint(tmp_path / "run").step
    options = replace(OPTIONS, minutes=1e-9, precision="bf16", device="auto")
    train(prior_shards, tmp_path / "run", options, log=lambda line: None)
    assert load_checkpoint(tmp_path / "run").step == done


def test_what_is_not_there_is_refused(prior_shards, tmp_path):
    for change, said in (
        ({"device": "tpu"}, "--device is tpu; choose from cpu, cuda, auto"),
        ({"precision": "int8"}, "--precision is int8"),
        ({"workers": -1}, "--workers is -1"),
    ):
        with pytest.raises(InputError, match=said):
            train(prior_shards, tmp_path / "run", replace(OPTIONS, **change), log=lambda line: None)
    if not torch.cuda.is_available():
        with pytest.raises(InputError, match="--device is cuda, but torch finds no GPU"):
            train(prior_shards, tmp_path / "run", replace(OPTIONS, device="cuda"), log=lambda line: None)


@pytest.mark.slow
def test_processes_make_the_batches_that_one_makes(prior_shards):
    make = partial(_part_batch, Work(prior_shards, shard_names(prior_shards), OPTIONS, 3), range(2))
    with made_by_processes(make, 2) as batches:
        for number in range(5):
            found, wanted = next(batches), make(number)
            assert torch.equal(found.image, wanted.image) and torch.equal(found.intrinsics, wanted.intrinsics)
            assert all(torch.equal(one, other) for one, other in zip(found.truth, wanted.truth, strict=True))
            assert found.image.is_contiguous(memory_format=torch.channels_last)
