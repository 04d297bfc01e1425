"""Figures of lengths against the truth, and which lengths are asked for."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.bench.lengths import Row, summary, tables
from room2dgs.config import load_config
from room2dgs.mesh.io import read_mesh, write_mesh
from room2dgs.runs.folder import write_config
from room2dgs.runs.metrics import record


def row(error: float | None, sigma: float) -> Row:
    return Row("a", "walls", "x", 4.0, None if error is None else 4.0 + error, None if error is None else sigma)


def test_shares_and_errors_are_of_what_was_found():
    figures = summary([row(0.001, 0.002), row(-0.003, 0.002), row(0.01, 0.002), row(None, 0)])
    assert figures["lengths"] == 4 and figures["found"] == 3
    assert figures["median_m"] == pytest.approx(0.003) and figures["bias_m"] == pytest.approx(0.001)
    assert figures["within_1_sigma"] == pytest.approx(1 / 3) and figures["within_2_sigma"] == pytest.approx(2 / 3)
    assert summary([row(None, 0)]) == {"lengths": 1, "found": 0}
    assert all(len(one.frame) for one in tables([row(None, 0)]))


@pytest.fixture
def made(wall, make, tmp_path):
    """A run in a box of 4 x 3 x 2.5 m whose truth says 4.01 m, with a capture that has it."""
    capture = tmp_path / "capture"
    capture.mkdir()
    for path in wall.iterdir():
        (capture / path.name).symlink_to(path)
    outline = [[-2.01, -1.5], [2.0, -1.5], [2.0, 1.5], [-2.01, 1.5]]
    room = {"outline": outline, "height_m": 2.5, "openings": []}
    (capture / "plan_true.json").write_text(json.dumps({"rooms": [room], "tops": []}))
    out = tmp_path / "run"
    out.mkdir()
    write_config(out, load_config([f"scene.path={capture}", f"out={out}"]))
    mesh: trimesh.Trimesh = make.room(spacing=0.1)
    inward = (mesh.face_normals * mesh.triangles_center).sum(axis=1) < 0
    mesh.faces[~inward] = mesh.faces[~inward][:, ::-1]
    mesh.vertex_attributes["expected_error"] = np.full(len(mesh.vertices), 0.004, np.float32)
    write_mesh(out / "mesh.ply", mesh)
    record(out, {"capture": {"metric": True}, "mesh_voxel_m": 0.01})
    return out


def test_a_run_is_held_against_its_capture_s_truth(made, tmp_path, capsys):
    to = tmp_path / "lengths.json"
    assert cli.main(["bench", "lengths", str(made), f"to={to}"]) == 0
    rows = {one["what"]: one for one in json.loads(to.read_text())["lengths"]}
    assert set(rows) == {"height", "wall 0 to 2", "wall 1 to 3"}
    assert rows["wall 1 to 3"]["error"] == pytest.approx(-0.01, abs=1e-4)
    assert rows["wall 0 to 2"]["error"] == pytest.approx(0, abs=1e-4) and rows["height"]["sigma"] < 0.006
    assert "within 2 σ" in capsys.readouterr().out
    assert cli.main(["bench", "plan", str(made), f"to={to}"]) == 0
    assert json.loads(to.read_text())["scores"]["walls"]["f"] == pytest.approx(1)
    assert cli.main(["bench", "lengths"]) == 2 and "no run is given" in capsys.readouterr().err
    (made.parent / "capture/plan_true.json").unlink()
    assert cli.main(["bench", "lengths", str(made)]) == 2
    assert "only made rooms" in capsys.readouterr().err


def test_a_top_is_measured_beside_what_stands_on_it(made, tmp_path):
    """A table of 1.2 x 0.8 m whose middle a box hides; the floor lies 1.25 m below the frame's origin."""
    parts = [read_mesh(made / "mesh.ply")]
    for extents, middle in (((1.2, 0.8, 0.04), (0, 0, -0.52)), ((0.7, 0.5, 0.3), (0, 0, -0.35))):
        box = trimesh.creation.box(extents=extents).subdivide_to_size(0.05)
        box.apply_translation(middle)
        parts.append(box)
    mesh = trimesh.util.concatenate(parts)
    mesh.vertex_attributes["expected_error"] = np.full(len(mesh.vertices), 0.004, np.float32)
    write_mesh(made / "mesh.ply", mesh)
    path = made.parent / "capture/plan_true.json"
    truth = json.loads(path.read_text())
    corners = [[-0.6, -0.4, -0.5], [0.6, -0.4, -0.5], [0.6, 0.4, -0.5], [-0.6, 0.4, -0.5]]
    path.write_text(json.dumps({**truth, "tops": [{"what": "table", "height_m": -0.5, "corners": corners}]}))
    to = tmp_path / "lengths.json"
    assert cli.main(["bench", "lengths", str(made), f"to={to}"]) == 0
    rows = {one["what"]: one for one in json.loads(to.read_text())["lengths"]}
    assert rows["table 0"]["value"] == pytest.approx(0.75, abs=1e-4)
