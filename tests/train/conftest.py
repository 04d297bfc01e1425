"""A tiny capture: a textured wall of surfels, seen by a few cameras, as PNG files."""

from __future__ import annotations

from contextlib import contextmanager

import cv2
import numpy as np
import pytest
import torch

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import load_config
from room2dgs.geometry.camera import Camera
from room2dgs.splat import Surfels
from room2dgs.splat.reference import render
from room2dgs.train import checkpoint

WIDTH, HEIGHT = 32, 24


def wall_points() -> PointCloud:
    """Points on z = 0, 0.1 m apart, in a pattern of colours."""
    x, y = np.meshgrid(np.arange(-0.8, 0.81, 0.1), np.arange(-0.6, 0.61, 0.1))
    xyz = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    rgb = 127 + 120 * np.stack([np.sin(5 * xyz[:, 0]), np.cos(7 * xyz[:, 1]), np.sin(9 * xyz.sum(1))], axis=1)
    return PointCloud(xyz, rgb.astype(np.uint8))


def cameras() -> list[Camera]:
    K = np.array([[30.0, 0, WIDTH / 2], [0, 30.0, HEIGHT / 2], [0, 0, 1]])
    poses = []
    for x in (-0.2, -0.1, 0.0, 0.1, 0.2):
        pose = np.eye(4)
        pose[:3, 3] = [-x, 0.3 * x, 1.5]  # cameras at z = -1.5 look along +z at the wall
        poses.append(pose)
    return [Camera(K, WIDTH, HEIGHT, pose) for pose in poses]


@pytest.fixture(scope="session")
def capture(tmp_path_factory):
    """(scene, points)."""
    folder = tmp_path_factory.mktemp("capture")
    points = wall_points()
    count = len(points)
    truth = Surfels(
        centers=torch.from_numpy(points.xyz).float(),
        rotations=torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
        scales=torch.full((count, 2), 0.07),
        opacities=torch.full((count,), 0.9),
        sh=((torch.from_numpy(points.rgb) / 255 - 0.5) / 0.28209479).float()[:, None],
    )
    frames = []
    for number, camera in enumerate(cameras()):
        K, pose = torch.from_numpy(camera.K).float(), torch.from_numpy(camera.cam_from_world).float()
        color = render(truth, K, pose, WIDTH, HEIGHT).color.clamp(0, 1).numpy()
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), (255 * color[:, :, ::-1]).round().astype(np.uint8))
        frames.append(Frame(f"{number:06d}", camera, path))
    return Scene(folder, train=tuple(frames[:2] + frames[3:]), test=(frames[2],)), points


@pytest.fixture
def configure(capture):
    """Builds a configuration for the tiny capture."""

    def build(*overrides: str):
        return load_config(
            [
                f"scene.path={capture[0].path}",
                "out=unused",
                "seeds.voxel_m=0.1",
                "seeds.per_seed=2",
                "train.iterations=8",
                "train.log_every=4",
                "train.test_every=0",
                "train.checkpoint_every=4",
                "train.tensorboard=false",
                "train.resolutions=[]",
                "train.opacity_floor.until=0",
                "loss.normal_consistency.start=3",
                # their own tests turn them on
                "loss.multiview_photometric.enabled=false",
                "strategy=fixed",
                *overrides,
            ]
        )

    return build


@pytest.fixture
def log():
    """A log that keeps its lines."""
    lines: list[str] = []

    def write(line: str) -> None:
        lines.append(line)

    write.lines = lines
    return write


@pytest.fixture
def dies_after(monkeypatch):
    """A block in which a run ends, as by Ctrl-C, once its checkpoint after an iteration is on the disk."""

    @contextmanager
    def block(iteration: int):
        save = checkpoint.save

        def save_and_die(out, state):
            save(out, state)
            if state.iteration == iteration:
                raise KeyboardInterrupt

        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(checkpoint, "save", save_and_die)
            yield

    return block
