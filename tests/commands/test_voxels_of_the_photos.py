"""Every command that makes a mesh takes the voxels that the photos call for where no side is given."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from room2dgs import cli

COMMANDS = {
    "depth": ["depth"],
    "mesh of depth": ["run", "mesh.source=depth", "report.enabled=false"],
    "mesh of stereo": ["run", "mesh.source=stereo", "report.enabled=false"],
    "mesh of points": ["run", "mesh.source=points", "report.enabled=false"],
    "run": ["run", "train.iterations=2", "report.enabled=false", "mesh.min_alpha=0", "mesh.max_angle_deg=90"],
}


@pytest.mark.parametrize("kind", COMMANDS)
def test_small_photos_get_voxels_of_two_centimetres(wall, tmp_path, capsys, kind):
    out, maps = tmp_path / "out", tmp_path / "maps"
    maps.mkdir()
    for photo in (wall / "color").iterdir():
        np.save(maps / f"{photo.stem}.npy", np.full(cv2.imread(str(photo)).shape[:2], 2.0, np.float32))
    settings = [f"scene.path={wall}", f"out={out}", "points.source=file", f"points.file={wall / 'points.ply'}"]
    settings += ["mesh.min_triangles=1", "mesh.max_error_m=null", "train.test_every=0", "train.tensorboard=false"]
    if kind != "depth":
        settings += ["prior=files", f"prior.depth.path={maps}", "prior.normal.source=none", "prior.depth.align=false"]
        settings += ["prior.depth.joint=false", "eval.samples=500"]
    assert cli.main([COMMANDS[kind][0], *settings, *COMMANDS[kind][1:]]) == 0
    assert "(voxels of 2 cm)" in capsys.readouterr().out
    if kind != "depth":
        assert json.loads((out / "metrics.json").read_text())["mesh_voxel_m"] == 0.02
