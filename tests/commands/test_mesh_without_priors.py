"""`room2dgs run` with mesh.source=stereo or points: a mesh of the wall without training, and without any prior."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.depth.network import ahead, maps
from room2dgs.pipeline import depth

WALL_Z = 2.0
SOURCES = ("stereo", "points")


def settings(wall, out, source: str) -> list[str]:
    points = ["points.source=file", f"points.file={wall / 'points.ply'}", "sfm.refine_poses=false"]
    mesh = [f"mesh.source={source}", "mesh.voxel_m=0.04", "mesh.min_triangles=10", "eval.samples=2000"]
    return [f"scene.path={wall}", f"out={out}", *points, *mesh, "prior=room_prior"]


class Looked(Exception):
    """A prior was asked for."""


@pytest.fixture
def no_prior(monkeypatch):
    """Whatever looks for a prior fails."""

    def looked(*arguments, **named):
        raise Looked

    for module, name in ((depth, "find_priors"), (ahead, "predicted_maps"), (maps, "open_network")):
        monkeypatch.setattr(module, name, looked)


@pytest.fixture(scope="module", params=SOURCES)
def finished(request, wall, tmp_path_factory):
    """Source and folder of a finished run."""
    out = tmp_path_factory.mktemp(request.param) / "run"
    assert cli.main(["run", *settings(wall, out, request.param)]) == 0
    return request.param, out


def test_the_mesh_lies_on_the_wall(finished):
    mesh = trimesh.load(finished[1] / "mesh.ply", process=False)
    # by area: what is flat has few vertices
    off = np.abs(trimesh.sample.sample_surface(mesh, 20_000, seed=0)[0][:, 2] - WALL_Z)
    assert np.median(off) < 0.02 and len(mesh.faces) > 100
    facing = np.average(mesh.face_normals[:, 2], weights=mesh.area_faces)
    assert facing < -0.9  # towards the cameras, which look along z
    assert np.ptp(mesh.vertices[:, 0]) > 2 and np.ptp(mesh.vertices[:, 1]) > 1
    textured = trimesh.load(finished[1] / "mesh.glb", force="mesh", process=False)
    assert textured.area == pytest.approx(mesh.area, rel=0.05)
    assert np.asarray(textured.visual.material.baseColorTexture).std() > 20  # the wall's pattern


def test_it_is_scored_timed_and_said_what_it_was_made_of(finished):
    source, out = finished
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["f_score_5cm"] > 0.5 and metrics["mesh_voxel_m"] == 0.04 and metrics["mesh_faces"] > 100
    assert metrics["priors"] == "none" and metrics["prior_networks"] == {} and metrics["points"] > 500
    assert metrics["depth_source"] == {"stereo": "stereo", "points": "none"}[source]
    timed = {
        "read",
        "poses",
        "points",
        "mesh",
        "texture",
        "eval",
        "report",
        "verdict",
        *(["stereo", "exposure"] if source == "stereo" else []),
    }
    assert timed == set(metrics["seconds"]) == set(metrics["cpu_seconds"])
    covered = metrics["stereo_coverage"]
    assert covered is None if source == "points" else 0.3 < covered < 1
    log = (out / "log.txt").read_text()
    assert "nothing was trained" in log and f"no priors (mesh.source={source})" in log
    assert not (out / "surfels.safetensors").exists() and not (out / "priors").exists()


def test_its_page_shows_the_mesh_and_says_where_it_is_from(finished):
    source, out = finished
    page = (out / "report.html").read_text()
    assert "nothing was trained" in page and 'data-layer="error"' in page and 'data-layer="discs"' not in page
    assert {"stereo": "the depth that stereo found", "points": "sparse points"}[source] in page
    pictures = json.loads(re.search(r'id="views">(.*?)</script>', page, re.S)[1])[-1]["pictures"]
    assert {"photo", "rendering", "difference", "depth", "normals"} <= set(pictures)
    assert ("trust" in pictures) == ("fewer agree" in page) == (source == "stereo")
    assert "network (" not in page


def test_later_commands_take_it_for_what_it_is(finished, capsys):
    source, out = finished
    assert cli.main(["mesh", f"out={out}"]) == 2
    assert f"type room2dgs run scene.path=DIR mesh.source={source}" in capsys.readouterr().err
    assert cli.main(["eval", f"out={out}"]) == 0
    assert cli.main(["report", f"run={out}"]) == 0
    assert cli.main(["export", f"run={out}", "to=glb"]) == 0


def test_no_prior_is_looked_at_and_the_same_bits_come_out_again(finished, no_prior, wall, tmp_path, capsys):
    source, first = finished
    again = tmp_path / "again"
    assert cli.main(["run", *settings(wall, again, source), "report.enabled=false", "render.threads=1"]) == 0
    assert (again / "mesh.ply").read_bytes() == (first / "mesh.ply").read_bytes()


def test_the_mesh_of_depth_looks_at_priors(no_prior, wall, tmp_path, monkeypatch, capsys):
    """Or the test above would see nothing."""
    assert cli.main(["run", *settings(wall, tmp_path / "ahead", "depth")]) == 1
    monkeypatch.setattr(ahead, "predicted_maps", lambda *arguments: None)
    assert cli.main(["run", *settings(wall, tmp_path / "run", "depth")]) == 1
    assert capsys.readouterr().err.count("Looked") >= 2


@pytest.mark.parametrize("finished", ["stereo"], indirect=True)
def test_stereo_meshes_what_depth_meshes(finished, wall, tmp_path):
    source, run = finished
    kept = [one for one in settings(wall, tmp_path / "depth", source) if not one.startswith(("mesh.source", "prior"))]
    assert cli.main(["depth", *kept, "report.enabled=false"]) == 0
    assert (tmp_path / "depth" / "mesh.ply").read_bytes() == (run / "mesh.ply").read_bytes()


def test_photos_that_tell_no_depth_are_one_sentence(wall, tmp_path, capsys):
    """Every camera at one place."""
    still = shutil.copytree(wall, tmp_path / "still")
    for pose in (still / "pose").glob("*.txt"):
        np.savetxt(pose, np.eye(4))
    assert cli.main(["run", *settings(still, tmp_path / "run", "stereo")]) == 2
    said = capsys.readouterr().err
    assert "no pixel of the depth maps may be fused; add photos that overlap" in said and said.count("\n") == 1
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("xyz", "said"),
    [
        (np.random.default_rng(0).random((15, 3)), "holds 15 points, at least 16 are needed"),
        (np.random.default_rng(0).random((40, 3)) - [0, 0, 9], "0 of 40 sparse points are seen by photos"),
        (np.tile([0.3, 0.1, 2.0], (40, 1)), "within mesh.voxel_m=0.04 of each other"),
    ],
)
def test_points_that_make_no_surface_are_one_sentence(wall, tmp_path, capsys, xyz, said):
    trimesh.PointCloud(xyz).export(tmp_path / "points.ply")
    arguments = [*settings(wall, tmp_path / "run", "points"), f"points.file={tmp_path / 'points.ply'}"]
    assert cli.main(["run", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and not (tmp_path / "run").exists()


@pytest.mark.parametrize("source", SOURCES)
def test_photos_without_points_are_told_of_the_depth_that_would_do(source, tmp_path, wall, capsys):
    import cv2

    blank = shutil.copytree(wall, tmp_path / "blank")
    for photo in (blank / "color").iterdir():
        cv2.imwrite(str(photo), np.full((48, 64, 3), 128, np.uint8))
    arguments = [*settings(blank, tmp_path / "run", source), "points.source=sfm", "points.max_features=100"]
    assert cli.main(["run", *arguments]) == 2
    said = capsys.readouterr().err
    assert "gives 0 points" in said and "or mesh.source=depth prior=room_prior for the network's depth" in said
