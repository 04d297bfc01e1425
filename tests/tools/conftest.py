"""Small rooms made once for all tests of the tools."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from room2dgs.demo_room.make import RoomOptions, make_room
from room2dgs.tools.make_captures import main as make_captures
from tests.oracles.made_captures import Capture, read_capture

TINY = {"frames": 12, "width": 96, "height": 72, "noise": 0.0, "jpeg_quality": 100}
FILMED = ("--seed", "77", "--photos", "6", "--width", "80", "--height", "60")


@pytest.fixture(scope="session")
def plain(tmp_path_factory) -> Capture:
    """A room with textured walls, no noise, constant exposure."""
    return read_capture(make_room(tmp_path_factory.mktemp("plain") / "room", RoomOptions(seed=3, **TINY)))


@pytest.fixture(scope="session")
def films(tmp_path_factory) -> list[Capture]:
    """Two random rooms, filmed with a few small photos."""
    out = tmp_path_factory.mktemp("films")
    assert make_captures([str(out), "--rooms", "2", *FILMED]) == 0
    return [read_capture(out / f"room_0{number}") for number in (0, 1)]


@pytest.fixture
def prior_shards(tmp_path) -> Path:
    """Two shards of six views each of one wall, as the prior network is trained on."""
    folder = tmp_path / "prior_data"
    for number in range(2):
        write_prior_shard(folder / f"shard_{number:05d}", views=6, seed=number)
    return folder


def write_prior_shard(path: Path, views: int, seed: int, width: int = 96, height: int = 72) -> None:
    """A shard of slanted walls with random dots."""
    rng = np.random.default_rng(seed)
    arrays = {
        "radiance": rng.integers(0, 256, (views, height, width, 3), dtype=np.uint8),
        "depth": np.zeros((views, height, width), np.float16),
        "normal": np.zeros((views, height, width, 3), np.int8),
        "focal": np.full(views, 80.0, np.float32),
    }
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    rays = np.stack([x / 80.0, y / 80.0, np.ones_like(x)], axis=-1)
    for view in range(views):
        normal = np.array([*rng.uniform(-0.4, 0.4, 2), -1.0])
        normal /= np.linalg.norm(normal)
        arrays["depth"][view] = normal @ (0.0, 0.0, 2.0) / (rays @ normal)
        arrays["normal"][view] = np.round(127 * normal)
    path.mkdir(parents=True)
    for name, array in arrays.items():
        np.save(path / f"{name}.npy", array)
