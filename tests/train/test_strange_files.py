"""Files of tensors in a run's folder may be a stranger's: what does not hold what training writes is one sentence."""

from __future__ import annotations

import json
import os
import re
import resource
import struct
from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import save

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.splat.types import Surfels
from room2dgs.train import checkpoint, train
from room2dgs.train.surfel_file import load_surfels, save_surfels
from room2dgs.train.tensor_file import read_tensors, write_tensors

COUNT = 5
GOOD = Surfels(
    torch.zeros(COUNT, 3), torch.tensor([[1.0, 0, 0, 0]]).repeat(COUNT, 1), torch.full((COUNT, 2), 0.02),
    torch.full((COUNT,), 0.5), torch.zeros(COUNT, 4, 3),
)  # fmt: skip


def refusal(path, **changed: torch.Tensor | None) -> str:
    tensors = {name: value for name, value in {**GOOD._asdict(), **changed}.items() if value is not None}
    write_tensors(path, "surfels", tensors, {})
    with pytest.raises(InputError) as caught:
        load_surfels(path)
    assert str(caught.value).startswith(str(path)) and str(caught.value).endswith("; train again")
    return str(caught.value)


def test_good_ones_come_back(tmp_path):
    save_surfels(tmp_path / "s", GOOD, {})
    assert all(torch.equal(a, b) for a, b in zip(load_surfels(tmp_path / "s"), GOOD, strict=True))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"sh": torch.zeros(COUNT, 7, 3)}, "has 7 spherical harmonics"),
        ({"sh": torch.zeros(COUNT, 4)}, r"sh of shape \(5, 4\)"),
        ({"sh": torch.zeros(COUNT, 4, 3, 1)}, "sh of shape"),
        ({"centers": torch.zeros(COUNT, 3, dtype=torch.int32)}, "centers as int32, not float32"),
        ({"centers": torch.zeros(COUNT, 3, dtype=torch.float64)}, "centers as float64"),
        ({"scales": torch.ones(COUNT, 2).to(torch.float8_e4m3fn)}, "scales as float8"),
        ({"opacities": torch.ones(COUNT, dtype=torch.bool)}, "opacities as bool"),
        ({"opacities": torch.tensor(0.5)}, "of shape"),
        ({"opacities": torch.full((COUNT - 1,), 0.5)}, r"centers of shape \(5, 3\), not \(4, 3\)"),
        ({"rotations": torch.zeros(COUNT, 3)}, "rotations of shape"),
        ({"rotations": None}, "lacks rotations"),
        ({"rotatoins": torch.zeros(1)}, "has rotatoins"),
        ({name: value[:0] for name, value in GOOD._asdict().items()}, "holds no surfels"),
        ({"centers": torch.full((COUNT, 3), torch.nan)}, "centers that are not finite"),
        ({"centers": torch.full((COUNT, 3), 1e30)}, "centers that are no metres"),
        ({"scales": torch.full((COUNT, 2), -0.02)}, "scales that are not above 0"),
        ({"scales": torch.zeros(COUNT, 2)}, "scales that are not above 0"),
        ({"opacities": torch.full((COUNT,), 1.5)}, "opacities that are not from 0 to 1"),
    ],
)  # fmt: skip
def test_surfels_that_are_none_are_told(tmp_path, changed, said):
    assert re.search(said, refusal(tmp_path / "surfels.safetensors", **changed))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\0" * 7,
        struct.pack("<Q", 1 << 60) + b"{}",
        struct.pack("<Q", 5 << 20) + b" " * (5 << 20),
        struct.pack("<Q", 2) + b"[]",
        struct.pack("<Q", 4_000_000) + b'{"a":' * 800_000,
        save({"centers": torch.zeros(3)}),
        save({"centers": torch.zeros(3)}, {"room2dgs": "[" * 100_000}),
        save({"centers": torch.zeros(3)}, {"room2dgs": json.dumps([1])}),
        save({"centers": torch.zeros(3)}, {"room2dgs": json.dumps({"kind": ["surfels"], "format": 1})}),
        save({"centers": torch.zeros(3)}, {"room2dgs": json.dumps({"kind": "surfels", "format": 1, "crc32": {}})}),
    ],
)
def test_a_header_that_is_none_is_one_sentence_in_little_memory(tmp_path, content):
    path = tmp_path / "surfels.safetensors"
    path.write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=r"surfels\.safetensors "):
        load_surfels(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # KiB


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "surfels.safetensors")
    with pytest.raises(InputError, match="is a pipe"):
        load_surfels(tmp_path / "surfels.safetensors")


@pytest.fixture(scope="module")
def trained(wall, tmp_path_factory):
    """A small run's folder with one checkpoint, its settings, and what it takes to go on with it."""
    out = tmp_path_factory.mktemp("trained")
    config = load_config(
        [f"scene.path={wall}", f"out={out}", "experiment=quick", "train.iterations=4", "train.refine_poses=true",
         "prior=none", "seeds.init=sfm"]
    )  # fmt: skip
    scene = read_scene(config.scene)
    xyz = np.random.default_rng(0).uniform((-1, -1, 1), (1, 1, 3), (60, 3))
    points = PointCloud(xyz, np.zeros((60, 3), np.uint8))
    train(scene, points, config, out, log=lambda line: None)
    return out, config, scene, points


def resumed(trained, tmp_path, change) -> str:
    """What is said when a run goes on with a checkpoint that `change` was done to."""
    out, config, scene, points = trained
    (path,) = checkpoint.on_disk(out)
    tensors, meta = read_tensors(path, checkpoint.KIND)
    meta = {name: meta[name] for name in ("iteration", "fingerprint", "seconds")}
    change(tensors, meta)
    write_tensors(checkpoint.folder_of(tmp_path) / path.name, checkpoint.KIND, tensors, meta)
    lines: list[str] = []
    try:
        train(scene, points, replace(config, resume=True), tmp_path, log=lines.append)
    except InputError as error:
        return str(error)
    return "\n".join(lines)


def put(name: str, *shape: int, value: float = 0.0):
    return lambda tensors, meta: tensors.update({name: torch.full(shape or tensors[name].shape, value)})


def drop(name: str):
    return lambda tensors, meta: tensors.pop(name)


def say(**values):
    return lambda tensors, meta: meta.update(values)


POSES = "extra/pose_corrections"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (drop("parameter/offsets"), "lacks offsets"),
        (put("parameter/more", 1), "has more, which the settings do not make"),
        (put("other/offsets", 1), "has other/offsets, which no checkpoint has"),
        (put("fixed/positions", 3, 3), "of shape"),
        (put("fixed/positions", 0, 3), "holds no seeds"),
        (put("parameter/rotations", value=torch.nan), "has rotations that is not finite"),
        (put("adam/exp_avg/offsets", 2), "has exp_avg/offsets of shape"),
        (put("adam/step/offsets", 2), "not one number"),
        (drop(f"{POSES}/mean"), "does not fit pose_corrections"),
        (put(f"{POSES}/values", 1, 6), "does not fit pose_corrections"),
        (say(iteration="4"), "does not say of which iteration"),
        (say(iteration=3), "does not say of which iteration"),
        (say(fingerprint=[]), "does not say of which iteration"),
        (say(seconds={"render": "long"}), "does not say of which iteration"),
        (say(), "resuming after iteration 4 of 4"),
    ],
)
def test_a_checkpoint_that_is_none_of_the_run_is_told(trained, tmp_path, change, said):
    assert said in resumed(trained, tmp_path, change)


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ([0.0, 0, 0, 0], [1.0, 0, 0, 0]),  # no rotation, as it is drawn
        ([0.0, 3e-30, 0, 4e-30], [0.0, 0.6, 0, 0.8]),
        ([0.0, 3e30, 0, 4e30], [0.0, 0.6, 0, 0.8]),
        ([0.3, 0, 0.4, 0], [0.3, 0, 0.4, 0]),  # to the bit: the length is divided out when it is drawn
    ],
)
def test_rotations_of_any_length_stay_the_same_rotations(tmp_path, written, read):
    path = tmp_path / "surfels.safetensors"
    one = Surfels(
        torch.zeros(1, 3),
        torch.tensor([written]),
        torch.full((1, 2), 0.01),
        torch.full((1,), 0.5),
        torch.zeros(1, 1, 3),
    )
    save_surfels(path, one, {})
    torch.testing.assert_close(load_surfels(path).rotations, torch.tensor([read]), rtol=1e-6, atol=0)
