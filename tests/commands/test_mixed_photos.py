"""Upright photos among lying ones, of several sizes, from reading to a trained mesh."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs import cli

FOCAL, OPENGL = 260.0, np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture
def mixed(corner_views, tmp_path) -> Path:
    """The corner as transforms.json: every other photo turned by a right angle, one of them at half the size."""
    root = tmp_path / "mixed"
    (root / "images").mkdir(parents=True)
    frames = []
    for index, (pose, photo, _) in enumerate(corner_views):
        shown, world_from_cam = photo, pose.copy()
        if index % 2:  # the camera turned to its right side: what was left is now up
            shown = np.ascontiguousarray(np.rot90(photo, -1))
            turn = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
            world_from_cam[:3, :3] = pose[:3, :3] @ turn
        scale = 0.5 if index == 3 else 1.0
        shown = cv2.resize(shown, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        height, width = shown.shape[:2]
        cv2.imwrite(str(root / f"images/{index}.png"), cv2.cvtColor(shown, cv2.COLOR_RGB2BGR))
        frames.append(
            {
                "file_path": f"images/{index}.png",
                "transform_matrix": (world_from_cam @ OPENGL).tolist(),
                **{"fl_x": FOCAL * scale, "fl_y": FOCAL * scale, "w": width, "h": height},
                **{"cx": width / 2, "cy": height / 2},
            }
        )
    (root / "transforms.json").write_text(json.dumps({"frames": frames}))
    return root


@pytest.mark.slow
def test_upright_and_lying_photos_go_through_stereo_and_training(mixed, corner_views, tmp_path):
    depth = tmp_path / "depth"
    common = [f"scene.path={mixed}", "scene.test_every=0", "scene.image_width=160", "points.max_features=1000"]
    assert cli.main(["depth", *common, f"out={depth}", "stereo.width=160", "mesh.voxel_m=0.03"]) == 0
    for index, (_, _, millimetres) in enumerate(corner_views):
        found, truth = np.load(depth / f"depth/images_{index}.npy"), millimetres / 1000.0
        if index % 2:
            truth = np.rot90(truth, -1)
        assert found.shape[::-1] == ((120, 160) if index % 2 else (160, 120))
        truth = cv2.resize(np.ascontiguousarray(truth), found.shape[::-1], interpolation=cv2.INTER_NEAREST)
        known = found > 0
        assert known.mean() > 0.3, index
        assert np.median(np.abs(found - truth)[known]) < 0.02, index
    out = tmp_path / "run"
    quick = ["train.iterations=12", "train.tensorboard=false", "mesh.voxel_m=0.05", "seeds.voxel_m=0.06"]
    assert cli.main(["run", *common, f"out={out}", "prior=none", *quick]) == 0
    assert json.loads((out / "metrics.json").read_text())["primitives"] > 100
    assert (out / "mesh.ply").is_file()
