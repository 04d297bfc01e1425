"""Pixels of mirrors, marked and true, are counted as they are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.mirrors.mirror import Mirror
from room2dgs.runs.trust import Trust
from room2dgs.tools.mirror_check import counted, line, main

SIZE = 40, 30


@pytest.fixture
def scene(wall, tmp_path):
    return read_scene(load_config([f"scene.path={wall}", f"out={tmp_path}"]).scene)


def mirror_before(camera) -> Mirror:
    """1 m before a camera, in the left half of what it sees."""
    x, y = -camera.K[0, 2] / camera.K[0, 0], camera.K[1, 2] / camera.K[1, 1]
    corners = np.array([[2 * x, -2 * y, 1], [0, -2 * y, 1], [0, 2 * y, 1], [2 * x, 2 * y, 1]])[::-1]
    return Mirror(corners @ camera.world_from_cam[:3, :3].T + camera.centre, 4)


def test_each_pixel_is_counted_once_for_what_it_is(scene, tmp_path):
    frame = scene.train[0]
    depth = np.full(SIZE[::-1], 5.0, np.float16)
    trust = {frame.name: Trust(np.full(SIZE[::-1], 255, np.uint8), np.full(SIZE[::-1], 9, np.uint8), depth)}
    masks = tmp_path / "mirror"
    masks.mkdir()
    mask = np.zeros((frame.camera.height, frame.camera.width), np.uint8)
    mask[: frame.camera.height // 2] = 255
    cv2.imwrite(str(masks / f"{int(frame.name)}.png"), mask)
    found = counted(scene, trust, [mirror_before(frame.camera)], masks)
    assert found["pixels"] == 1200 and found["mirror"] == 600
    assert found["marked"] == pytest.approx(600, abs=30) and found["both"] == pytest.approx(300, abs=15)
    assert found["right"] == 0  # the wall is nearer than 5 m
    said = line("run", [mirror_before(frame.camera)], found)
    assert said.startswith("run: 1 mirrors (") and "precision 0.5" in said


def test_without_mirrors_nothing_is_marked(scene, tmp_path):
    frame = scene.train[0]
    trust = {frame.name: Trust(*np.zeros((2, *SIZE[::-1]), np.uint8), np.full(SIZE[::-1], 5.0, np.float16))}
    found = counted(scene, trust, [], tmp_path / "none")
    assert found["marked"] == found["mirror"] == 0
    assert "precision -, recall -" in line("run", [], found)


def test_a_folder_without_a_run_is_told(tmp_path, capsys):
    assert main([str(tmp_path)]) == 2
    assert "holds no run" in capsys.readouterr().err
