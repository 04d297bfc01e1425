"""A capture without metres is worked in metres by the depth prior's estimate of its unit, by every step alike."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.captures.poses_file import read_unit
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.pipeline import reconstruct as steps
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.runs.folder import saved_settings
from room2dgs.runs.page.texts import logged_warnings
from tests.pipeline.unknown_unit import WALL_Z, capture_of, overrides, run

FIFTH = 0.2  # units of a metre, so that one unit is 5 m
TRAINED = ["mesh.source=surfels", "train.iterations=12", "train.checkpoint_every=4", "train.tensorboard=false"]
TRAINED += ["seeds.voxel_m=0.1", "mesh.voxel_m=0.06", "mesh.min_triangles=1", "mesh.max_error_m=null"]


def lines(out) -> list[str]:
    return (out / "log.txt").read_text().splitlines()


def unit_of(out) -> dict:
    return json.loads((out / "metrics.json").read_text())["unit"]


def wall_z(path) -> float:
    return float(np.median(trimesh.load(path, process=False).vertices[:, 2]))


@pytest.fixture(scope="module")
def small(wall, tmp_path_factory):
    """The wall in units of 5 m."""
    return capture_of(wall, tmp_path_factory.mktemp("unit") / "small", FIFTH)


@pytest.mark.parametrize(("factor", "about"), [(0.001, "1e+03"), (0.02, "50"), (0.4, "2.5"), (5.0, "0.2")])
def test_the_mesh_is_in_metres_whatever_the_unit(wall, tmp_path, factor, about):
    out = tmp_path / "out"
    assert run(capture_of(wall, tmp_path / "capture", factor), out, "mesh.voxel_m=0.04") == 0
    assert unit_of(out)["metres"] == pytest.approx(1 / factor, rel=1e-3)
    assert unit_of(out)["source"] == "depth prior" and unit_of(out)["photos"] == 7
    assert wall_z(out / "mesh.ply") == pytest.approx(WALL_Z, abs=0.01)
    assert any(f"1 unit of the poses is about {about} m (± 30 %)" in line for line in lines(out))
    assert json.loads((out / "metrics.json").read_text())["prior_scale"] == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("factor", [0.7, 1.0, 1.5])
def test_poses_that_may_be_metres_are_taken_as_such(wall, tmp_path, factor):
    """Networks are off by as much, and most such captures are in metres."""
    out = tmp_path / "out"
    assert run(capture_of(wall, tmp_path / "capture", factor), out, "mesh.voxel_m=0.04") == 0
    assert wall_z(out / "mesh.ply") == pytest.approx(factor * WALL_Z, abs=0.01)
    assert unit_of(out)["metres"] == 1 and unit_of(out)["estimate_m"] == pytest.approx(1 / factor, rel=1e-3)
    assert any("lengths are taken as metres, which fits" in line for line in lines(out))


@pytest.mark.parametrize(("unit", "z"), [("1", FIFTH * WALL_Z), ("2.5", 2.5 * FIFTH * WALL_Z)])
def test_a_given_unit_is_used_as_it_is(small, tmp_path, unit, z):
    out = tmp_path / "out"
    points = trimesh.load(small / "points.ply")
    points.apply_scale(float(unit))
    points.export(tmp_path / "points.ply")  # metres, as the unit is given
    more = [f"scene.unit={unit}", f"points.file={tmp_path / 'points.ply'}", "mesh.voxel_m=0.02"]
    assert run(small, out, *more) == 0
    assert wall_z(out / "mesh.ply") == pytest.approx(z, abs=0.01)
    assert unit_of(out) == {"metres": float(unit), "source": "scene.unit"}


def test_metric_poses_are_left_alone(wall, tmp_path):
    """However much a prior contradicts them: that is a warning."""
    maps = tmp_path / "maps"
    maps.mkdir()
    for path in (wall / "color").iterdir():
        np.save(maps / f"{path.stem}.npy", np.full((48, 64), 5 * WALL_Z, np.float32))
    out = tmp_path / "out"
    given = [f"points.file={wall / 'points.ply'}", f"prior.depth.path={maps}", "mesh.voxel_m=0.04"]
    assert run(wall, out, *given) == 0
    assert wall_z(out / "mesh.ply") == pytest.approx(WALL_Z, abs=0.01)
    assert unit_of(out) == {"metres": 1.0, "source": "capture"}
    assert "unit" not in json.loads((out / "poses.json").read_text())
    assert any("if they are not, give scene.unit=5" in line for line in logged_warnings(lines(out)))


@pytest.mark.parametrize("more", [["mesh.source=points", "prior=none"], ["prior.depth.source=none"]])
def test_without_a_prior_the_unit_is_warned_of(small, tmp_path, capsys, more):
    run(small, tmp_path / "out", "mesh.voxel_m=0.02", *more)
    warned = logged_warnings(capsys.readouterr().out.splitlines())
    assert any("the unit of the poses is unknown" in line for line in warned)


def test_maps_that_contradict_each_other_tell_no_unit(wall, tmp_path):
    capture = capture_of(wall, tmp_path / "capture", FIFTH)
    for number, path in enumerate(sorted((capture / "maps").iterdir())):
        np.save(path, np.full((48, 64), WALL_Z * 8.0 ** (number % 3), np.float32))
    out = tmp_path / "out"
    run(capture, out, "mesh.voxel_m=0.02")
    assert any("is too uncertain" in line for line in logged_warnings(lines(out)))
    assert unit_of(out) == {"metres": 1.0, "source": "assumed"}


def test_a_truth_counts_in_the_unit_of_the_poses(wall, small, tmp_path):
    truth = trimesh.load(wall / "gt_mesh.ply")
    truth.apply_scale(FIFTH)
    truth.export(tmp_path / "gt.ply")
    out = tmp_path / "out"
    assert run(small, out, "mesh.voxel_m=0.04", f"eval.gt={tmp_path / 'gt.ply'}") == 0
    assert json.loads((out / "metrics.json").read_text())["accuracy_m"] < 0.01


def test_exported_cameras_stand_where_the_run_had_them(small, tmp_path):
    out = tmp_path / "out"
    assert run(small, out, "mesh.voxel_m=0.04") == 0
    centres = [frame.camera.centre for frame in scene_of_run(saved_settings(out)).frames]
    np.testing.assert_allclose(np.ptp(centres, axis=0), (0.7, 0, 0), rtol=1e-3, atol=1e-9)
    assert cli.main(["export", f"run={out}", "to=transforms", f"out={tmp_path / 'export'}"]) == 0
    written = json.loads((next((tmp_path / "export").rglob("transforms.json"))).read_text())
    x = [frame["transform_matrix"][0][3] for frame in written["frames"]]
    assert max(x) - min(x) == pytest.approx(0.7, rel=1e-3)


def test_a_run_that_was_stopped_goes_on_in_the_same_metres(small, tmp_path, monkeypatch):
    """From a checkpoint, too: then the unit is the one in poses.json, though the prior might say another by then."""
    whole, out = tmp_path / "whole", tmp_path / "out"
    assert run(small, whole, *TRAINED) == 0
    with monkeypatch.context() as patched:
        patched.setattr(steps, "make_mesh", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            steps.start_run(overrides(small, out, *TRAINED))
    asked = []
    monkeypatch.setattr("room2dgs.pipeline.poses.estimated_unit", lambda *_, **__: asked.append(1))
    assert cli.main(["run", f"out={out}", "resume=true"]) == 0
    assert not asked
    for name in ("poses.json", "surfels.safetensors", "mesh.ply"):
        assert (out / name).read_bytes() == (whole / name).read_bytes(), name
    assert wall_z(out / "mesh.ply") == pytest.approx(WALL_Z, abs=0.2)


def test_the_mesh_is_made_again_in_the_same_metres(small, tmp_path):
    out = tmp_path / "out"
    assert run(small, out, *TRAINED) == 0
    before = (out / "mesh.ply").read_bytes()
    (out / "mesh.ply").unlink()
    assert cli.main(["mesh", f"out={out}"]) == 0
    assert (out / "mesh.ply").read_bytes() == before


@pytest.mark.parametrize("unit", [{}, {"metres": -1, "sigma": 0.3, "photos": 3}, {"metres": "x"}, 5])
def test_a_damaged_unit_is_refused(small, tmp_path, unit):
    path = tmp_path / "poses.json"
    path.write_text(json.dumps({"kind": "room2dgs poses", "unit": unit}))
    scene = scene_of_run(load_config([f"scene.path={small}", f"out={tmp_path / 'none'}"]))
    with pytest.raises(InputError, match="is not a file of refined poses"):
        read_unit(path, scene)
