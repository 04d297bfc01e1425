"""`room2dgs run mesh.source=depth`: a mesh without training, of the wall's sensor depth."""

from __future__ import annotations

import json
import re

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs import cli

WALL_Z = 2.0


def settings(wall, out) -> list[str]:
    points = ["points.source=file", f"points.file={wall / 'points.ply'}", "sfm.refine_poses=false"]
    return [
        f"scene.path={wall}",
        f"out={out}",
        *points,
        "mesh.source=depth",
        "mesh.voxel_m=0.04",
        "mesh.min_triangles=10",
    ]


@pytest.fixture
def maps(wall, tmp_path):
    """Depth of the wall, 3 cm too far in one half, with a confidence that says so."""
    for photo in (wall / "color").iterdir():
        height, width = cv2.imread(str(photo)).shape[:2]
        depth = np.full((height, width), WALL_Z, np.float32)
        depth[:, width // 2 :] += 0.03
        (tmp_path / "maps").mkdir(exist_ok=True)
        np.save(tmp_path / "maps" / f"{photo.stem}.npy", depth)
    return tmp_path / "maps"


def test_nothing_is_trained_and_the_mesh_is_scored(wall, maps, tmp_path, capsys):
    out = tmp_path / "run"
    prior = ["prior=files", "prior.normal.source=none", f"prior.depth.path={maps}", "prior.depth.align=false"]
    assert cli.main(["run", *settings(wall, out), *prior, "prior.depth.joint=false"]) == 0
    assert "nothing was trained" in capsys.readouterr().out
    assert not (out / "surfels.safetensors").exists()
    mesh = trimesh.load(out / "mesh.ply", process=False)
    vertices = trimesh.sample.sample_surface(mesh, 20_000, seed=0)[0]  # by area: what is flat has few vertices
    assert np.quantile(vertices[:, 2], 0.05) > WALL_Z - 0.005 and np.quantile(vertices[:, 2], 0.95) < WALL_Z + 0.035
    metrics = json.loads((out / "metrics.json").read_text())
    assert "primitives" not in metrics and metrics["depth_source"] == "files" and metrics["mesh_faces"] > 100
    assert metrics["stereo_coverage"] is None  # the photos were not compared
    page = (out / "report.html").read_text()
    assert "nothing was trained" in page and 'data-layer="error"' in page and "How the training went" not in page
    assert 'data-layer="discs"' not in page  # there are none
    views = json.loads(re.search(r'id="views">(.*?)</script>', page, re.S)[1])
    assert {"photo", "rendering", "difference", "depth", "normals", "trust"} <= set(views[-1]["pictures"])
    # the mesh with its fused colours looks like the photos; black would have 10 dB
    assert all(float(re.search(r"PSNR of ([\d.]+)", view["note"])[1]) > 15 for view in views)
    assert cli.main(["export", f"run={out}", "to=glb"]) == 0
    assert cli.main(["export", f"run={out}", "to=splats"]) == 2
    assert "has no surfels: mesh.source=depth trains nothing" in capsys.readouterr().err
    assert cli.main(["eval", f"out={out}"]) == 0
    assert cli.main(["mesh", f"out={out}"]) == 2
    assert "room2dgs run" in capsys.readouterr().err


def test_metrics_say_what_share_stereo_covers(wall, maps, tmp_path):
    out = tmp_path / "run"
    prior = ["prior=files", "prior.normal.source=none", f"prior.depth.path={maps}", "prior.depth.completion=false"]
    assert cli.main(["run", *settings(wall, out), *prior, "report.enabled=false", "eval.samples=1000"]) == 0
    share = json.loads((out / "metrics.json").read_text())["stereo_coverage"]
    assert share > 0.3 and f"stereo: {share:.0%} of the pixels" in (out / "log.txt").read_text()


def test_without_any_depth_it_says_so(wall, tmp_path, capsys):
    assert cli.main(["run", *settings(wall, tmp_path / "run"), "prior=none"]) == 2
    assert "prior=room_prior" in capsys.readouterr().err


def test_depth_of_the_keyframes_alone_is_read_and_the_other_photos_are_matched_with_them(wall, maps, tmp_path, capsys):
    out = tmp_path / "run"
    prior = ["prior=files", "prior.normal.source=none", f"prior.depth.path={maps}", "scene.keyframes=0.5"]
    assert cli.main(["run", *settings(wall, out), *prior, "scene.test_every=4", "report.enabled=false"]) == 0
    said = capsys.readouterr().out
    assert "6 training views, 3 of them keyframes, 2 held out" in said
    rows = (out / "priors.csv").read_text().splitlines()[1:]
    assert len(rows) == 3
    assert "% of the pixels of 3 views have a depth" in said
    assert json.loads((out / "metrics.json").read_text())["stereo_coverage"] > 0.3
    assert np.load(out / "trust.npz", allow_pickle=False)["names"].size == 3
