"""`room2dgs measure` of a run's folder."""

from __future__ import annotations

import json

import numpy as np
import pytest

from room2dgs import cli
from room2dgs.config import load_config
from room2dgs.mesh.io import write_mesh
from room2dgs.runs.folder import write_config
from room2dgs.runs.metrics import record


@pytest.fixture
def run(wall, make, tmp_path):
    """A room of 4 x 3 x 2.5 m about the origin whose surface is good to 4 mm."""
    out = tmp_path / "run"
    out.mkdir()
    write_config(out, load_config([f"scene.path={wall}", f"out={out}"]))
    room = make.room(spacing=0.1)
    inward = (room.face_normals * room.triangles_center).sum(axis=1) < 0
    room.faces[~inward] = room.faces[~inward][:, ::-1]
    room.vertex_attributes["expected_error"] = np.full(len(room.vertices), 0.004, np.float32)
    write_mesh(out / "mesh.ply", room)
    record(out, {"capture": {"metric": True}, "unit": {"metres": 1.0, "source": "capture"}, "mesh_voxel_m": 0.01})
    return out


def measured(capsys, *arguments) -> dict:
    assert cli.main(["measure", *map(str, arguments)]) == 0
    return json.loads(capsys.readouterr().out)


def test_planes_points_and_rooms(run, capsys, tmp_path):
    height = measured(capsys, run, "up=z", "floor", "ceiling")
    assert height["value"] == pytest.approx(2.5, abs=1e-6) and height["unit"] == "m"
    assert height["parts"]["scale"] == pytest.approx(0.0125) and "assumed" in height["scale"]
    assert 0.001 < height["parts"]["surface"] < 0.006
    assert measured(capsys, run, "up=z", "height")["value"] == pytest.approx(2.5, abs=1e-6)
    sure = measured(capsys, run, "up=z", "height", "scale_sigma=0")
    assert sure["parts"]["scale"] == 0 and sure["sigma"] < height["sigma"]
    points = measured(capsys, run, "-2,0,0", "2,0,0")
    assert points["value"] == pytest.approx(4) and points["parts"]["surface"] == pytest.approx(0.004 * 2**0.5, rel=1e-4)
    plane = measured(capsys, run, "plane@-2,0,0", "1.0,1.5,0.3", "scale_sigma=0")
    assert plane["value"] == pytest.approx(3, abs=1e-4)
    angle = measured(capsys, run, "up=z", "floor", "wall_1")
    assert angle["unit"] == "degrees" and angle["value"] == pytest.approx(90, abs=0.01)
    to = tmp_path / "all.json"
    rooms = measured(capsys, run, "up=z", f"to={to}")
    assert rooms == json.loads(to.read_text())
    assert [one["what"] for one in rooms["lengths"]][:2] == ["height", "room 1, wall_1"]
    assert sorted(one["value"] for one in rooms["lengths"]) == pytest.approx([2.5, 3, 3, 4, 4], abs=1e-4)
    assert rooms["areas"][0]["value"] == pytest.approx(12) and 0 < rooms["areas"][0]["sigma"] < 0.2


def test_the_plan_carries_the_deviations(run, capsys):
    assert cli.main(["plan", str(run), "up=z"]) == 0
    assert "height 2.500 m ± " in capsys.readouterr().out
    plan = json.loads((run / "plan/plan.json").read_text())
    assert all(0.01 < side["length"]["sigma"] < 0.05 for side in plan["rooms"][0]["sides"])
    assert "± " in (run / "plan/plan.svg").read_text()
    assert "± " in (run / "plan/plan.dxf").read_text()


def test_an_unknown_scale_gives_units(run, capsys):
    record(run, {"capture": {"metric": False}, "unit": {"metres": 1.0, "source": "assumed"}})
    height = measured(capsys, run, "up=z", "height")
    assert height["unit"] == "units" and height["parts"]["scale"] == 0 and "unknown" in height["scale"]
    assert cli.main(["plan", str(run), "up=z"]) == 0
    assert "height 2.5 ± 0.00" in capsys.readouterr().out
    assert "units" in (run / "plan/plan.svg").read_text()


def test_what_cannot_be_measured_is_said(run, capsys, make):
    for arguments, words in (
        ([], "run=DIR"),
        ([run, "floor"], "1 ends of a length"),
        ([run, "floor", "sky"], "nothing to measure from"),
        ([run, "up=z", "floor", "wall_9"], "no wall_9"),
        ([run, "0,0,0", "2,0,0"], "off the mesh"),
        ([run, "nobody:1,2", "2,0,0"], "no photo"),
        ([run, "up=z", "height", "scale_sigma=x"], "relative deviation"),
    ):
        assert cli.main(["measure", *map(str, arguments)]) == 2
        assert words in capsys.readouterr().err
    write_mesh(run / "mesh.ply", make.room(spacing=0.1))
    assert cli.main(["measure", str(run), "up=z", "height"]) == 2
    assert "does not say how sure it is; make it again with `room2dgs mesh" in capsys.readouterr().err
