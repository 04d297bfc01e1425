from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh

from room2dgs.captures.read import read_scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import dump_config, load_config
from room2dgs.eval.pictures import error_mesh
from room2dgs.eval.surface import Surface
from room2dgs.mesh.io import write_mesh
from room2dgs.pipeline.surfels import render_frames
from room2dgs.runs.page.write import write_report
from room2dgs.runs.trust import write_trust
from room2dgs.splat.types import Surfels
from room2dgs.train.surfel_file import save_surfels

HOSTILE = Path("<script>alert(1)<", "script>&'\"")  # as a path: a folder and one inside it
LOG = """\
iteration 10/20: loss 0.5000 (rgb 0.4000, normal_prior 0.1000), PSNR 18.00 dB, 30 surfels, 9.0 it/s, 0.1 min left
iteration 20/20: loss 0.9000 (rgb 0.9000), 40 surfels, 9.0 it/s, 0.0 min left
resuming after iteration 10 of 20
iteration 20/20: loss 0.2500 (rgb 0.2000, normal_prior 0.0500), PSNR 24.00 dB, 40 surfels, 9.0 it/s, 0.0 min left
iteration 20/20: held-out PSNR 22.50 dB
WARNING: <b>the normals</b> are poor
"""
METRICS = {
    "protocol": "area",
    "f_score_5cm": 0.625,
    "psnr_db": 19.0,
    "test_views": {"0": {}},
    "primitives": 1200,
    "mesh_faces": 1280,
    "iterations": 20,
    "depth_source": "room_prior",
    "seconds": {"read": 1.0, "train": 9.0},
    "stage_peak_memory_mb": {"read": 500.0, "train": 750.0},
    "protocols": {"area": {"f_score_5cm": 0.625, "accuracy_m": 0.0123, "constants": {}}},
    "versions": {"room2dgs": "0.1.0"},
}


def discs_on(mesh: trimesh.Trimesh) -> Surfels:
    """One disc a vertex, at z, with its normal away from the cameras."""
    centers = torch.tensor(np.asarray(mesh.vertices), dtype=torch.float32)
    count = len(centers)
    rotations = torch.tensor([[1.0, 0, 0, 0]]).repeat(count, 1)
    return Surfels(
        centers, rotations, torch.full((count, 2), 0.04), torch.full((count,), 0.8), torch.full((count, 1, 3), 0.5)
    )


@pytest.fixture(scope="session")
def reported(wall, tmp_path_factory):
    """A run's folder as it is before its report, and the report of it; the capture's path is hostile."""
    folder = tmp_path_factory.mktemp("reported")
    capture = folder / HOSTILE
    capture.parent.mkdir(parents=True)
    capture.symlink_to(wall)
    out = folder / "run"
    config = load_config(
        [f"scene.path='{folder / 'link'}'", f"out={out}", "train.iterations=20", "report.views=2", "scene.test_every=4"]
    )
    config.scene.path = str(capture)
    scene = read_scene(config.scene)
    mesh = trimesh.load(wall / "gt_mesh.ply", process=False)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.full((len(mesh.vertices), 3), 200, np.uint8))
    write_mesh(out / "mesh.ply", mesh)
    write_mesh(out / "eval" / "error.ply", error_mesh(mesh, Surface(mesh), 0.05))
    (out / "log.txt").write_text(LOG)
    (out / "metrics.json").write_text(json.dumps(METRICS))
    (out / "config.yaml").write_text(dump_config(config))
    depth = np.full((48, 64), 2.0, np.float32)
    depth[:12] = 0
    sure = np.where(depth > 0, np.float32(0.5), np.float32(0))
    count = np.zeros((48, 64), np.int32)
    count[24:] = 4
    names = [frame.name for frame in scene.train]
    maps = {name: ViewMaps(depth=depth, depth_confidence=sure) for name in names}
    write_trust(out / "trust.npz", scene.train, maps, {name: (depth, count) for name in names})
    surfels = discs_on(mesh)
    path = write_report(scene, surfels, lambda frames: render_frames(surfels, frames, config), config, out)
    return SimpleNamespace(path=path, out=out, capture=capture, mesh=mesh, surfels=surfels, scene=scene, config=config)


@pytest.fixture
def finished(wall, tmp_path):
    """The folder of a small run that was trained and meshed, with a truth to score it by."""
    out = tmp_path / "run"
    config = load_config(
        [
            f"scene.path={wall}",
            f"out={out}",
            "scene.test_every=4",
            "report.views=1",
            "report.max_surfels=50",
            "eval.samples=500",
        ]
    )
    mesh = trimesh.load(wall / "gt_mesh.ply", process=False)
    write_mesh(out / "mesh.ply", mesh)
    save_surfels(out / "surfels.safetensors", discs_on(mesh), {"iteration": 20})
    (out / "log.txt").write_text(LOG)
    (out / "metrics.json").write_text(json.dumps(METRICS))
    (out / "config.yaml").write_text(dump_config(config))
    return out
