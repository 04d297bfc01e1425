"""One made scene, written in each layout from the layout's description: numbers as the format has them, by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs.tools.capture_layouts.colmap import colmap_text
from room2dgs.tools.capture_layouts.made import Made
from room2dgs.tools.capture_layouts.registry import LAYOUTS
from room2dgs.tools.capture_layouts.ros_messages import RosMessages

WIDTH, HEIGHT = 96, 72
COUNT = 6
FX, FY, CX, CY = 81.0, 84.0, 46.5, 37.25  # pixel centres at +0.5
K = np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1.0]])


@pytest.fixture(scope="session")
def made() -> Made:
    random = np.random.default_rng(7)
    poses = np.tile(np.eye(4), (COUNT, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(random.uniform(-0.25, 0.25, (COUNT, 3))).as_matrix()
    poses[:, :3, 3] = random.uniform(-0.4, 0.4, (COUNT, 3))
    photos = random.integers(0, 255, (COUNT, HEIGHT // 8, WIDTH // 8, 3), np.uint8)
    photos = np.stack([cv2.resize(photo, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC) for photo in photos])
    depths = random.integers(500, 4000, (COUNT, HEIGHT, WIDTH)).astype(np.uint16)
    depths[:, :4] = 0
    xyz = random.uniform([-2.0, -1.5, 2.0], [2.0, 1.5, 4.0], (600, 3))
    rgb = random.integers(0, 255, (600, 3), np.uint8)
    seen = []
    for pose in poses:
        at = (xyz - pose[:3, 3]) @ pose[:3, :3]
        pixel = at[:, :2] / at[:, 2:] * (FX, FY) + (CX, CY)
        index = np.flatnonzero(((pixel > 0) & (pixel < (WIDTH, HEIGHT))).all(axis=1))
        seen.append((index, pixel[index]))
    mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
    mask[:10, :10] = 0
    return Made(K, (WIDTH, HEIGHT), poses, photos, depths, xyz, rgb, seen, mask=mask)


@pytest.fixture
def written(tmp_path: Path, made: Made):
    """`written(name)` gives the folder of the made scene in a layout; `written(name, made=other)` of another."""

    def write(name: str, **changes) -> Path:
        root = tmp_path / name
        LAYOUTS[name].write(root, changes.get("made", made))
        return root

    return write


@pytest.fixture
def colmap_writer():
    """`colmap_writer(folder, made, names, camera, poses)` writes a text model."""
    return colmap_text


@pytest.fixture
def settings(default_config):
    """`settings(path, **changes)` gives a SceneConfig with nothing held out."""
    return lambda path, **changes: replace(default_config.scene, **{"path": str(path), "test_every": 0, **changes})


@pytest.fixture
def ros_messages():
    """`ros_messages(ros1)` makes messages and bags."""
    return RosMessages


@pytest.fixture
def settings_of(settings, made):
    """`settings_of(root, name)` gives what a person says of the made scene in a layout."""
    return lambda root, name: settings(root, **LAYOUTS[name].settings(made))
