"""What training views are rendered over."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from room2dgs import splat
from room2dgs.train import load_surfels, train
from room2dgs.train.step import background

RANDOM = "train.random_background=true"


def test_each_iteration_has_a_colour_of_its_own_and_always_the_same(configure):
    config = configure(RANDOM)
    colors = [tuple(background(number, config, torch.device("cpu")).tolist()) for number in range(20)]
    assert colors == [tuple(background(number, config, torch.device("cpu")).tolist()) for number in range(20)]
    assert len(set(colors)) == 20 and np.ptp(colors) > 0.7
    assert tuple(background(0, configure(RANDOM, "train.seed=1"), torch.device("cpu")).tolist()) != colors[0]


def test_without_it_is_the_configured_one(configure):
    config = configure("render.background=[0.25,0.5,1.0]")
    assert background(3, config, torch.device("cpu")).tolist() == [0.25, 0.5, 1.0]


@pytest.fixture
def black_wall(capture, tmp_path):
    """The capture, its wall painted black after its points got their colours: (scene, points)."""
    scene, points = capture

    def painted(frame):
        path = tmp_path / frame.color_path.name
        cv2.imwrite(str(path), np.zeros_like(cv2.imread(str(frame.color_path))))
        return replace(frame, color_path=path)

    return replace(scene, train=tuple(map(painted, scene.train)), test=tuple(map(painted, scene.test))), points


@pytest.mark.parametrize("random", [True, False])
def test_what_is_as_dark_as_the_background_is_opaque_all_the_same(black_wall, configure, log, tmp_path, random):
    scene, points = black_wall
    config = configure("train.iterations=150", f"train.random_background={str(random).lower()}")
    surfels = load_surfels(train(scene, points, config, tmp_path / "run", log).surfels_path)
    camera = scene.train[0].camera
    K, pose = (torch.from_numpy(matrix).float() for matrix in (camera.K, camera.cam_from_world))
    alpha = splat.render(surfels, K, pose, camera.width, camera.height).alpha[6:-6, 8:-8]
    assert (alpha.min() > 0.9) == random
