"""Small rooms made once for all tests of the generator, and an independent reader of their files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.tools.make_captures import main as make_captures
from room2dgs.tools.make_room import RoomOptions, make_room

TINY = {"frames": 12, "width": 96, "height": 72, "noise": 0.0, "jpeg_quality": 100}
FILMED = ("--seed", "77", "--photos", "6", "--width", "80", "--height", "60")


@dataclass(frozen=True)
class Capture:
    """A room read back from its files: K for centres at +0.5, poses world_from_cam, depths in metres."""

    path: Path
    K: np.ndarray
    poses: list[np.ndarray]
    colors: list[np.ndarray]
    depths: list[np.ndarray]

    def rays(self) -> np.ndarray:
        """(H, W, 3) directions through the pixel centres in the camera, z = 1."""
        height, width = self.depths[0].shape
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        return np.stack([(x - self.K[0, 2]) / self.K[0, 0], (y - self.K[1, 2]) / self.K[1, 1], np.ones_like(x)], -1)

    def points(self, index: int) -> np.ndarray:
        """(H, W, 3) world positions of a frame's pixels; meaningless where the depth is 0."""
        in_cam = self.rays() * self.depths[index][..., None]
        return in_cam @ self.poses[index][:3, :3].T + self.poses[index][:3, 3]


def read_capture(path: Path) -> Capture:
    """Reads a ScanNet folder without the project's own reader."""
    K = np.loadtxt(path / "intrinsic/intrinsic_color.txt")[:3, :3]
    K[:2, 2] += 0.5
    count = len(list((path / "pose").iterdir()))
    return Capture(
        path,
        K,
        [np.loadtxt(path / f"pose/{i}.txt") for i in range(count)],
        [cv2.imread(str(path / f"color/{i}.jpg")).astype(np.float64) for i in range(count)],
        [cv2.imread(str(path / f"depth/{i}.png"), cv2.IMREAD_UNCHANGED) / 1000.0 for i in range(count)],
    )


@pytest.fixture(scope="session")
def plain(tmp_path_factory) -> Capture:
    """A room with textured walls, no noise, constant exposure."""
    return read_capture(make_room(tmp_path_factory.mktemp("plain") / "room", RoomOptions(seed=3, **TINY)))


@pytest.fixture(scope="session")
def drifting(tmp_path_factory) -> Capture:
    """The same room under a drifting exposure."""
    options = RoomOptions(seed=3, exposure_drift=1.0, **TINY)
    return read_capture(make_room(tmp_path_factory.mktemp("drifting") / "room", options))


@pytest.fixture(scope="session")
def blank(tmp_path_factory) -> Capture:
    """Another seed, all walls blank, a polished floor."""
    options = RoomOptions(seed=4, blank_walls=4, gloss=0.8, **TINY)
    return read_capture(make_room(tmp_path_factory.mktemp("blank") / "room", options))


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
