"""Training: resumed, continued, refused."""

from dataclasses import replace

import pytest
import torch

from room2dgs.errors import InputError
from room2dgs.tools.prior_network.checkpoint import load_checkpoint, save_checkpoint
from room2dgs.tools.prior_network.options import TrainOptions, learning_rate_factor
from room2dgs.tools.prior_network.training import train
from room2dgs.tools.train_prior import main

OPTIONS = TrainOptions(
    size=(64, 32), steps=6, batch=4, warmup=2, validate_every=3, validation_samples=4, save_minutes=0.0
)


class Killed(Exception):
    pass


def quiet(line: str) -> None:
    pass


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def same_tensors(one, other) -> bool:
    return all(torch.equal(one[part][name], other[part][name]) for part in one for name in one[part])


@pytest.mark.slow
def test_a_broken_off_run_ends_with_the_bits_of_an_unbroken_one_on_one_thread_or_two(prior_shards, tmp_path):
    whole = load_checkpoint(train(prior_shards, tmp_path / "whole", OPTIONS, threads=2, log=quiet))

    def kill(line: str) -> None:
        if line.startswith("step 3 validation"):
            raise Killed

    with pytest.raises(Killed):
        train(prior_shards, tmp_path / "broken", OPTIONS, log=kill)
    assert load_checkpoint(tmp_path / "broken").step == 3
    # shards made meanwhile are left out
    (prior_shards / "shard_00001").rename(prior_shards / "shard_00009")
    (prior_shards / "shard_00001").symlink_to(prior_shards / "shard_00009")
    resumed = load_checkpoint(train(prior_shards, tmp_path / "broken", OPTIONS, log=quiet))
    assert resumed.step == whole.step == 6
    assert resumed.shards == ["shard_00000", "shard_00001"]
    assert same_tensors(resumed.tensors, whole.tensors)
    assert not same_tensors({"a": whole.tensors["weights"]}, {"a": whole.tensors["average"]})


@pytest.mark.slow
def test_training_learns_and_writes_its_curves(prior_shards, tmp_path):
    lines: list[str] = []
    options = replace(OPTIONS, steps=30, validate_every=15, warmup=0, save_minutes=60.0)
    train(prior_shards, tmp_path / "run", options, log=lines.append)
    angles = [float(line.split("normal_mean ")[1].split(",")[0]) for line in lines if "validation" in line]
    reported = [float(line.split("loss ")[1].split(",")[0]) for line in lines if "samples/s" in line]
    assert reported[-1] < reported[0]
    before, after, end = angles  # at steps 15 and 30, and of what was written
    assert after < 0.9 * before
    assert end == after
    assert list((tmp_path / "run/tensorboard").iterdir())
    assert [path.name for path in (tmp_path / "run").glob("*.safetensors")] == ["checkpoint.safetensors"]


def test_another_run_starts_from_a_checkpoint_at_another_size(prior_shards, tmp_path):
    first = load_checkpoint(train(prior_shards, tmp_path / "first", OPTIONS, log=quiet))
    options = replace(OPTIONS, size=(96, 64), steps=1, lr=1e-8, warmup=0, decay=0.0)
    second = load_checkpoint(train(prior_shards, tmp_path / "second", options, tmp_path / "first", log=quiet))
    assert (second.step, second.total_steps) == (1, first.total_steps + 1)
    assert second.history[0]["options"]["size"] == [64, 32]
    for name, weight in first.tensors["weights"].items():
        torch.testing.assert_close(second.tensors["weights"][name], weight, atol=1e-6, rtol=0)
    # the moments go on too: one step forgets a tenth
    name = "heads.2.bias"
    assert float((second.tensors["moment2"][name] / first.tensors["moment2"][name]).min()) > 0.9


def test_a_run_goes_on_from_a_smaller_network_with_its_weights(prior_shards, tmp_path):
    path = train(prior_shards, tmp_path / "first", OPTIONS, log=quiet)
    first = load_checkpoint(path)
    for part in first.tensors.values():
        part["heads.2.weight"], part["heads.2.bias"] = part["heads.2.weight"][:6], part["heads.2.bias"][:6]
        for name in [name for name in part if name.startswith("finer_context.")]:
            del part[name]
    save_checkpoint(path, first)
    with pytest.raises(InputError, match="another network"):
        load_checkpoint(path)
    grown = load_checkpoint(path, grow=True)
    for name, part in grown.tensors.items():
        torch.testing.assert_close(part["heads.2.weight"][:6], first.tensors[name]["heads.2.weight"], rtol=0, atol=0)
    assert not any(grown.tensors["moment"]["heads.2.weight"][6:].any(dim=1).flatten())
    assert grown.tensors["weights"]["heads.2.weight"][6:].any()
    options = replace(OPTIONS, steps=1, lr=1e-8, warmup=0, decay=0.0)
    second = load_checkpoint(train(prior_shards, tmp_path / "second", options, tmp_path / "first", log=quiet))
    assert second.total_steps == first.total_steps + 1


def test_a_folder_of_another_run_is_not_trained_on(prior_shards, tmp_path):
    train(prior_shards, tmp_path / "run", replace(OPTIONS, steps=1), log=quiet)
    with pytest.raises(InputError, match="with steps 1, not 2"):
        train(prior_shards, tmp_path / "run", replace(OPTIONS, steps=2), log=quiet)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"size": (100, 64)}, "--size is 100x64"),
        ({"batch": 0}, "--batch is 0"),
        ({"decay": 1.5}, "--decay is 1.5"),
        ({"held_out": 2}, "2 are held out"),
    ],
)
def test_settings_out_of_range_are_named(prior_shards, tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        train(prior_shards, tmp_path / "run", replace(OPTIONS, **change), log=quiet)
    assert not (tmp_path / "run" / "checkpoint.safetensors").exists()


def test_a_checkpoint_that_is_none_is_named_on_the_command_line(prior_shards, tmp_path, capsys):
    (tmp_path / "other.safetensors").write_bytes(b"nothing")
    arguments = [str(prior_shards), str(tmp_path / "run"), "--size", "64x32", "--from", f"{tmp_path}/other.safetensors"]
    assert main(arguments) == 2
    assert "other.safetensors" in capsys.readouterr().err


def test_the_rate_rises_stays_and_falls():
    options = TrainOptions(steps=100, warmup=9, decay=0.2)
    factors = [learning_rate_factor(options, step, 0.0) for step in range(101)]
    assert factors[:3] == pytest.approx([0.1, 0.2, 0.3])
    assert factors[9:80] == pytest.approx([1.0] * 71)
    assert factors[90] == pytest.approx(0.5)
    assert factors[100] == 0.0


def test_the_clock_ends_a_run_of_minutes():
    options = TrainOptions(steps=10**6, minutes=2.0, warmup=0, decay=0.5)
    assert learning_rate_factor(options, 10, 30.0) == 1.0
    assert learning_rate_factor(options, 10, 90.0) == pytest.approx(0.5)
    assert learning_rate_factor(options, 10, 120.0) == 0.0
