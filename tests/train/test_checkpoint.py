import json
import struct
from pathlib import Path

import pytest
import torch

from room2dgs import files
from room2dgs.errors import InputError
from room2dgs.train import checkpoint
from room2dgs.train.checkpoint import Checkpoint
from room2dgs.train.surfel_file import load_surfels


def state(iteration: int) -> Checkpoint:
    return Checkpoint(
        iteration,
        parameters={"offsets": torch.full((3, 2, 3), float(iteration), requires_grad=True)},
        fixed={"positions": torch.arange(9.0).reshape(3, 3)},
        adam={"step/offsets": torch.tensor(7.0), "exp_avg/offsets": torch.ones(3, 2, 3)},
        fingerprint={"train.seed": 0, "train.resolutions": [{"fraction": 0.5, "until": 3}]},
        seconds={"render": 1.5},
    )


def ignore(line: str) -> None:
    pass


def test_what_is_saved_comes_back(tmp_path):
    checkpoint.save(tmp_path, state(5))
    back = checkpoint.latest(tmp_path, ignore)
    assert back.iteration == 5 and back.seconds == {"render": 1.5}
    assert back.fingerprint == state(5).fingerprint
    for name in ("parameters", "fixed", "adam"):
        mine, theirs = getattr(state(5), name), getattr(back, name)
        assert mine.keys() == theirs.keys()
        assert all(torch.equal(mine[key], theirs[key]) for key in mine)


def test_same_state_same_bytes(tmp_path):
    first = checkpoint.save(tmp_path / "a", state(5)).read_bytes()
    assert first == checkpoint.save(tmp_path / "b", state(5)).read_bytes()


def test_newest_is_by_number_not_by_name(tmp_path):
    for iteration in (9_999_999, 10_000_000, 20):
        checkpoint.save(tmp_path, state(iteration))
    assert checkpoint.latest(tmp_path, ignore).iteration == 10_000_000


def test_no_folder_no_checkpoint(tmp_path):
    assert checkpoint.latest(tmp_path / "nothing", ignore) is None


@pytest.mark.parametrize("stage", ["write", "fsync", "replace"])
def test_a_disk_that_fills_leaves_the_last_one_and_no_litter(tmp_path, monkeypatch, stage):
    checkpoint.save(tmp_path, state(1))

    def full(*_):
        raise OSError(28, "No space left on device")

    def half_then_full(path, data):
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        full()

    target, name = {
        "write": (Path, "write_bytes"),
        "fsync": (files.os, "fsync"),
        "replace": (files.os, "replace"),
    }[stage]
    with monkeypatch.context() as patch:
        patch.setattr(target, name, half_then_full if stage == "write" else full)
        with pytest.raises(InputError, match=r"iteration_0000002.*No space left"):
            checkpoint.save(tmp_path, state(2))
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["iteration_0000001.safetensors"]
    assert checkpoint.latest(tmp_path, ignore).iteration == 1


def test_a_kill_in_mid_write_leaves_the_last_one(tmp_path, monkeypatch):
    checkpoint.save(tmp_path, state(1))

    def killed(path, data):
        with path.open("wb") as file:
            file.write(data[:100])
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", killed)
        patch.setattr(Path, "unlink", lambda *_, **__: None)  # nothing tidies up after a kill
        with pytest.raises(KeyboardInterrupt):
            checkpoint.save(tmp_path, state(2))
    assert checkpoint.latest(tmp_path, ignore).iteration == 1
    assert len(list(checkpoint.folder_of(tmp_path).iterdir())) == 2
    files.remove_leftovers(checkpoint.folder_of(tmp_path), owned=True)
    assert len(list(checkpoint.folder_of(tmp_path).iterdir())) == 1


@pytest.mark.parametrize("damage", ["empty", "header", "cut", "flip", "zeros"])
def test_a_damaged_file_is_passed_over_and_named(tmp_path, damage):
    checkpoint.save(tmp_path, state(1))
    newest = checkpoint.save(tmp_path, state(2))
    data = bytearray(newest.read_bytes())
    if damage == "flip":
        data[-5] ^= 1
    cut = {"empty": 0, "header": 30, "cut": len(data) - 8}.get(damage, len(data))
    newest.write_bytes(bytes(len(data)) if damage == "zeros" else bytes(data[:cut]))
    lines = []
    assert checkpoint.latest(tmp_path, lines.append).iteration == 1
    assert len(lines) == 1 and newest.name in lines[0]


def test_a_newer_format_is_refused(tmp_path):
    path = checkpoint.save(tmp_path, state(1))
    data = path.read_bytes()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8 : 8 + size])
    header["__metadata__"]["room2dgs"] = header["__metadata__"]["room2dgs"].replace('"format": 1', '"format": 9')
    new = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(new)) + new + data[8 + size :])
    with pytest.raises(InputError, match="format 9"):
        checkpoint.load(path)


def test_other_checkpoints_are_deleted_and_other_files_are_not(tmp_path):
    paths = [checkpoint.save(tmp_path, state(i)) for i in (1, 2, 3)]
    note = checkpoint.folder_of(tmp_path) / "note.txt"
    note.write_text("mine")
    checkpoint.keep_only(tmp_path, paths[1:])
    assert checkpoint.on_disk(tmp_path) == paths[1:] and note.exists()


def test_a_checkpoint_is_not_a_file_of_surfels(tmp_path):
    path = checkpoint.save(tmp_path, state(1))
    with pytest.raises(InputError, match="does not hold a surfels"):
        load_surfels(path)
