"""`room2dgs plan` of a run's folder: files and sentences."""

from __future__ import annotations

import json

import pytest
import torch

from room2dgs import cli
from room2dgs.config import load_config
from room2dgs.mesh.io import write_mesh
from room2dgs.runs.folder import write_config
from room2dgs.splat.types import Surfels
from room2dgs.train import save_surfels


@pytest.fixture
def run(wall, make, tmp_path):
    out = tmp_path / "run"
    out.mkdir()
    write_config(out, load_config([f"scene.path={wall}", f"out={out}"]))
    one = Surfels(
        torch.zeros(1, 3), torch.tensor([[1.0, 0, 0, 0]]), torch.ones(1, 2), torch.ones(1) / 2, torch.zeros(1, 1, 3)
    )
    save_surfels(out / "surfels.safetensors", one, {})
    room = make.room(spacing=0.1)
    inward = (room.face_normals * room.triangles_center).sum(axis=1) < 0
    room.faces[~inward] = room.faces[~inward][:, ::-1]
    write_mesh(out / "mesh.ply", room)
    return out


def test_files_of_a_plan(run, capsys):
    assert cli.main(["plan", f"run={run}", "up=z"]) == 0
    assert "room 1: 12.00 m², height 2.500 m" in capsys.readouterr().out
    plan = json.loads((run / "plan/plan.json").read_text())
    assert sorted(side["length_m"] for side in plan["rooms"][0]["sides"]) == pytest.approx([3, 3, 4, 4], abs=1e-4)
    floor = plan["planes"][0]
    assert floor["name"] == "floor" and floor["offset_m"] == pytest.approx(-1.25)  # as conftest's room stands
    assert {path.name for path in (run / "plan").iterdir()} == {"plan.json", "plan.svg", "plan.dxf"}


def test_what_cannot_be_drawn_is_said(run, tmp_path, capsys):
    for arguments, words in (
        ([], "run=DIR"),
        ([f"run={tmp_path}"], "holds no run"),
        ([f"run={run}", "up=keep"], "up=auto"),
    ):
        assert cli.main(["plan", *arguments]) == 2
        assert words in capsys.readouterr().err
    (run / "mesh.ply").unlink()
    assert cli.main(["plan", f"run={run}"]) == 2
    assert "room2dgs mesh" in capsys.readouterr().err
