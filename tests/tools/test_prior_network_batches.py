"""Which samples make a batch."""

import threading

import numpy as np
import pytest
import torch

from room2dgs.errors import InputError
from room2dgs.tools.prior_network.batches import _sample_at, read_ahead, training_batch, validation_batch
from room2dgs.tools.prior_network.shards import open_shards, shard_names

SIZE = (64, 32)


def batches_equal(one, other) -> bool:
    pairs = zip((one.image, one.intrinsics, *one.truth), (other.image, other.intrinsics, *other.truth), strict=True)
    return all(torch.equal(a, b) for a, b in pairs)


def test_each_pass_shows_every_sample_once_in_another_order():
    passes = [[_sample_at(place, 12, seed=3) for place in range(12 * n, 12 * n + 12)] for n in range(3)]
    assert all(sorted(order) == list(range(12)) for order in passes)
    assert passes[0] != passes[1] != passes[2]


def test_a_batch_does_not_depend_on_how_it_is_cut(prior_shards):
    shards = open_shards(prior_shards, shard_names(prior_shards))
    whole, part = training_batch(shards, SIZE, range(4), 0), training_batch(shards, SIZE, range(2, 4), 0)
    assert torch.equal(whole.image[2:], part.image)
    assert torch.equal(whole.truth.normal[2:], part.truth.normal)
    assert batches_equal(whole, training_batch(shards, SIZE, range(4), 0))
    assert not batches_equal(whole, training_batch(shards, SIZE, range(4), 1))


def test_shapes_and_validation_that_stays_the_same(prior_shards):
    shards = open_shards(prior_shards, shard_names(prior_shards))
    batch = validation_batch(shards, SIZE, [0, 11], 0)
    assert batch.image.shape == (2, 3, 32, 64)
    assert batch.image.is_contiguous(memory_format=torch.channels_last)
    assert batch.truth.depth.shape == (2, 1, 16, 32)
    assert batch.truth.normal.shape == (2, 3, 16, 32)
    assert batches_equal(batch, validation_batch(shards, SIZE, [0, 11], 0))


def test_samples_come_from_their_shard(prior_shards):
    shards = open_shards(prior_shards, shard_names(prior_shards))
    assert len(shards) == 12
    assert np.array_equal(shards[5].radiance, np.load(prior_shards / "shard_00000/radiance.npy")[5])
    assert np.array_equal(shards[6].depth, np.load(prior_shards / "shard_00001/depth.npy")[0])


def test_read_ahead_keeps_the_order_and_its_thread_ends():
    before = threading.active_count()
    with read_ahead(lambda number: number) as numbers:
        assert [next(numbers) for _ in range(10)] == list(range(10))
    assert threading.active_count() == before


def test_read_ahead_raises_what_the_maker_raised():
    def make(number: int) -> int:
        if number == 2:
            raise InputError("shard is damaged")
        return number

    with read_ahead(make) as numbers, pytest.raises(InputError, match="damaged"):
        for _ in range(3):
            next(numbers)


def test_folders_that_are_no_complete_shards_are_passed_over(prior_shards):
    (prior_shards / ".shard_00002.partial-1").mkdir()
    (prior_shards / ".shard_00002.partial-1" / "focal.npy").touch()
    (prior_shards / "notes").mkdir()
    assert shard_names(prior_shards) == ["shard_00000", "shard_00001"]


def test_no_data_is_said_in_one_sentence(tmp_path):
    with pytest.raises(InputError, match="is not a folder"):
        shard_names(tmp_path / "missing")
    with pytest.raises(InputError, match="holds no shards"):
        shard_names(tmp_path)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("depth", np.zeros((6, 72, 96), np.float32)),
        ("normal", np.zeros((6, 72, 96), np.int8)),
        ("radiance", np.zeros((6, 72, 90, 3), np.uint8)),
        ("focal", np.zeros(5, np.float32)),
    ],
)
def test_a_wrong_array_is_named(prior_shards, name, array):
    np.save(prior_shards / "shard_00001" / f"{name}.npy", array)
    with pytest.raises(InputError, match=rf"shard_00001/{name}\.npy"):
        open_shards(prior_shards, shard_names(prior_shards))


def test_a_truncated_array_is_named(prior_shards):
    file = prior_shards / "shard_00000/depth.npy"
    file.write_bytes(file.read_bytes()[:500])
    with pytest.raises(InputError, match=r"shard_00000/depth\.npy cannot be read"):
        open_shards(prior_shards, shard_names(prior_shards))


def test_shards_of_two_sizes_are_refused(prior_shards):
    for name, shape in (("radiance", (6, 36, 48, 3)), ("depth", (6, 36, 48)), ("normal", (6, 36, 48, 3))):
        file = prior_shards / f"shard_00001/{name}.npy"
        np.save(file, np.zeros(shape, np.load(file).dtype))
    with pytest.raises(InputError, match="48x36"):
        open_shards(prior_shards, shard_names(prior_shards))
