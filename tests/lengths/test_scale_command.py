"""`room2dgs scale`: all files of a run follow a known length, together or not at all."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
import torch
import trimesh

from room2dgs import cli, open_run
from room2dgs.captures.in_metres import EstimatedUnit
from room2dgs.captures.poses_file import write_poses
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.eval.boundary_kinds import COLORS
from room2dgs.lengths.scaled_files import scaled_glb, scaled_ply
from room2dgs.mesh.boundary_file import BoundaryEdges, read_boundary, write_boundary
from room2dgs.mesh.io import write_mesh
from room2dgs.mirrors.mirror import Mirror
from room2dgs.pipeline.scene import read_capture
from room2dgs.runs import replacing
from room2dgs.runs.folder import write_config
from room2dgs.runs.metrics import record
from room2dgs.runs.mirrors import read_mirrors, write_mirrors
from room2dgs.splat.types import Surfels
from room2dgs.train import save_surfels

MIRROR = np.array([[0.5, 1.5, -0.5], [0.5, 1.5, 0.5], [-0.5, 1.5, 0.5], [-0.5, 1.5, -0.5]])


@pytest.fixture
def run(wall, make, tmp_path):
    """A run in a room of 4 x 3 x 2.5 m, with surfels, poses, scores, an export and a checkpoint."""
    out = tmp_path / "run"
    out.mkdir()
    config = load_config([f"scene.path={wall}", f"out={out}"])
    write_config(out, config)
    room = make.room(spacing=0.1)
    inward = (room.face_normals * room.triangles_center).sum(axis=1) < 0
    room.faces[~inward] = room.faces[~inward][:, ::-1]
    room.vertex_attributes["expected_error"] = np.full(len(room.vertices), 0.004, np.float32)
    write_mesh(out / "mesh.ply", room)
    (out / "mesh.glb").write_bytes(room.export(file_type="glb"))
    rim = BoundaryEdges(np.array([[[0.0, 0, 1], [0, 0.5, 1]]]), np.array([1], np.uint8))
    write_boundary(out / "boundary.ply", rim, COLORS, (0.0, 0.0, 0.0))
    write_mirrors(out / "mirrors.json", [Mirror(MIRROR, 9)], (0.0, 0.0, 0.0))
    one = Surfels(
        torch.tensor([[1.0, 2, 3]]),
        torch.tensor([[1.0, 0, 0, 0]]),
        torch.full((1, 2), 0.1),
        torch.ones(1) / 2,
        torch.zeros(1, 1, 3),
    )
    save_surfels(out / "surfels.safetensors", one, {"iteration": 7})
    scene = read_capture(config)
    write_poses(out / "poses.json", scene, scene, {"moved_m": 0.01, "refined": False})
    (out / "priors.csv").write_text("view,scale,shift,median_relative_residual,points\n0,0.8,0.1,0.03,100\n")
    (out / "checkpoints").mkdir()
    (out / "checkpoints/iteration_0000007.safetensors").write_bytes(b"old")
    record(
        out,
        {
            "capture": {"metric": False},
            "unit": {"metres": 1.0, "source": "assumed"},
            "mesh_voxel_m": 0.02,
            "boundary_m": {"free": 0.0, "not_seen": 0.5, "not_trusted": 0.0},
            "f_score_5cm": 0.9,
        },
    )
    assert cli.main(["export", str(out), "to=splats", "up=z"]) == 0
    assert cli.main(["plan", str(out), "up=z"]) == 0
    return out


def state(out) -> dict[str, bytes]:
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and path.name != "log.txt"
    }


def test_all_files_follow(run, capsys):
    before = open_run(run)
    cameras, mesh = dict(before.cameras), before.mesh
    assert cli.main(["scale", str(run), "up=z", "floor", "ceiling", "length=5+-0.01"]) == 0
    assert "all lengths times 2," in capsys.readouterr().out
    after = open_run(run)
    np.testing.assert_allclose(after.mesh.vertices, 2 * mesh.vertices, rtol=1e-6)
    np.testing.assert_allclose(after.surfels.centers, [[2, 4, 6]])
    np.testing.assert_allclose(after.surfels.scales, [[0.2, 0.2]])
    for name, camera in after.cameras.items():
        np.testing.assert_allclose(camera.centre, 2 * cameras[name].centre, atol=1e-9)
        np.testing.assert_array_equal(camera.rotation, cameras[name].rotation)
    glb = trimesh.load(run / "mesh.glb", force="mesh")
    np.testing.assert_allclose(np.ptp(glb.vertices, axis=0), 2 * np.ptp(mesh.vertices, axis=0), rtol=1e-6)
    assert after.settings.scene.unit == pytest.approx(2)
    metrics = after.metrics
    assert metrics["unit"]["source"] == "known length" and metrics["mesh_voxel_m"] == pytest.approx(0.04)
    assert metrics.get("f_score_5cm") is None and metrics["boundary_m"]["not_seen"] == pytest.approx(1.0)
    rim = read_boundary(run / "boundary.ply", len(COLORS), (0.0, 0.0, 0.0))
    np.testing.assert_allclose(rim.ends, [[[0, 0, 2], [0, 1, 2]]])
    assert list(rim.kind) == [1]
    np.testing.assert_allclose(read_mirrors(run / "mirrors.json", (0.0, 0.0, 0.0))[0].corners, 2 * MIRROR)
    assert json.loads((run / "poses.json").read_text())["report"]["moved_m"] == pytest.approx(0.02)
    assert "0,1.6,0.2,0.03,100" in (run / "priors.csv").read_text()
    assert not (run / "checkpoints").exists() and not (run / replacing.PLACE).exists()
    plan = json.loads((run / "plan/plan.json").read_text())
    assert plan["height_m"] == pytest.approx(5, abs=1e-4) and plan["height"]["unit"] == "m"
    assert (run / "export/splats.ply").is_file()
    capsys.readouterr()
    assert cli.main(["measure", str(run), "up=z", "height"]) == 0
    height = json.loads(capsys.readouterr().out)
    assert height["value"] == pytest.approx(5, abs=1e-4) and "a known length" in height["scale"]
    assert 0.01 < height["parts"]["scale"] < 0.02 and height["parts"]["surface"] > 0.004  # errors grew as well


def test_twice_is_once_by_both_factors(run):
    assert cli.main(["scale", str(run), "up=z", "floor", "ceiling", "length=5"]) == 0
    assert cli.main(["scale", str(run), "up=z", "-4,0,0", "4,0,0", "length=4"]) == 0
    assert open_run(run).settings.scene.unit == pytest.approx(1.0, rel=1e-6)


def test_an_estimated_unit_becomes_a_given_one(run, wall):
    scene = read_capture(load_config([f"scene.path={wall}", "out=x"]))
    from room2dgs.captures.in_metres import in_metres

    unit = EstimatedUnit(1.5, 0.3, 8)
    scaled = in_metres(scene, unit)
    write_poses(run / "poses.json", scaled, scaled, {}, unit)
    assert cli.main(["scale", str(run), "up=z", "floor", "ceiling", "length=5"]) == 0
    after = open_run(run)
    assert after.settings.scene.unit == pytest.approx(3.0)
    name = scene.frames[2].name
    np.testing.assert_allclose(after.cameras[name].centre, 3 * scene.frames[2].camera.centre, atol=1e-9)


@pytest.mark.parametrize("stop_at", [0, 1, 3, 6])
def test_stopped_at_any_rename_it_goes_on_and_others_wait(run, monkeypatch, capsys, stop_at):
    whole = run.parent / "whole"
    import shutil

    shutil.copytree(run, whole)
    text = (whole / "config.yaml").read_text().replace(str(run), str(whole))
    (whole / "config.yaml").write_text(text)
    arguments = ["up=z", "floor", "ceiling", "length=5"]
    assert cli.main(["scale", str(whole), *arguments]) == 0
    count = 0
    real = os.replace

    def killed(source, target):
        nonlocal count
        if f"/{replacing.PLACE}/" in str(source) and f"/{replacing.PLACE}/" not in str(target):
            count += 1
            if count > stop_at:
                raise KeyboardInterrupt
        real(source, target)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(replacing.os, "replace", killed)
        from room2dgs.commands.scale import main

        main([f"run={run}", *arguments])
    assert cli.main(["measure", str(run), "height"]) == 2
    assert "two scales" in capsys.readouterr().err
    assert cli.main(["scale", str(run)]) == 0
    mine, other = state(run), state(whole)
    assert mine.keys() == other.keys()
    for name in ("mesh.ply", "surfels.safetensors", "poses.json", "priors.csv", "plan/plan.json"):
        assert mine[name] == other[name], name


def test_stopped_before_the_commit_nothing_has_changed(run, monkeypatch, capsys):
    before = state(run)
    from room2dgs.pipeline import rescale

    def full(*_):
        raise InputError("no room left")

    monkeypatch.setattr(rescale, "commit", full)
    assert cli.main(["scale", str(run), "up=z", "floor", "ceiling", "length=5"]) == 2
    kept = {name: data for name, data in state(run).items() if not name.startswith(replacing.PLACE)}
    assert kept == before
    assert cli.main(["measure", str(run), "up=z", "height"]) == 0


def test_what_cannot_be_scaled_is_said(run, capsys):
    for arguments, words in (
        (["floor", "ceiling"], "two ends and length"),
        (["floor", "length=2"], "two ends and length"),
        (["floor", "ceiling", "length=x"], "no length in metres"),
        (["-2,0,0", "-1.9998,0.0,0", "length=1"], "too short"),
        (["floor", "ceiling", "length=1e9"], "check its unit"),
    ):
        assert cli.main(["scale", str(run), "up=z", *arguments]) == 2
        assert words in capsys.readouterr().err


def test_only_lengths_of_a_file_are_scaled():
    mesh = trimesh.creation.box()
    mesh.visual.vertex_colors = np.tile([10, 20, 30, 255], (8, 1))
    mesh.vertex_attributes["views"] = np.arange(8, dtype=np.int32)
    mesh.vertex_attributes["expected_error"] = np.full(8, 0.01, np.float32)
    data = mesh.export(file_type="ply")
    again = scaled_ply(scaled_ply(data, 2.0, "x"), 0.5, "x")
    assert again == data
    twice = trimesh.load(trimesh.util.wrap_as_stream(scaled_ply(data, 2.0, "x")), file_type="ply", process=False)
    np.testing.assert_allclose(twice.vertices, 2 * mesh.vertices)
    np.testing.assert_array_equal(twice.visual.vertex_colors, mesh.visual.vertex_colors)
    raw = twice.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(np.ravel(raw["views"]), np.arange(8))
    np.testing.assert_allclose(np.ravel(raw["expected_error"]), 0.02)
    for bad in (b"", data[:-700], data.replace(b"binary_little_endian", b"ascii")):
        with pytest.raises(InputError, match="mesh the run again"):
            scaled_ply(bad, 2.0, "x")
    with pytest.raises(InputError, match="no GLB"):
        scaled_glb(data, 2.0, "x")
