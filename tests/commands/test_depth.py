"""`room2dgs depth`: maps, a point cloud and a mesh of a wall whose place is known."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from room2dgs import cli

WALL_Z = 2.0


@pytest.fixture(scope="module")
def out(wall, tmp_path_factory):
    out = tmp_path_factory.mktemp("depth") / "out"
    arguments = [f"scene.path={wall}", f"out={out}", "points.source=file", f"points.file={wall / 'points.ply'}"]
    more = ["mesh.voxel_m=0.04", "mesh.min_triangles=10", "scene.test_every=4"]
    assert cli.main(["depth", *arguments, *more]) == 0
    return out


def test_maps_of_every_training_photo_lie_on_the_wall(out):
    names = {path.stem for path in (out / "depth").glob("*.npy")}
    assert len(names) == 6  # two of the eight are held out
    depths, normals, errors = ([np.load(out / kind / f"{name}.npy") for name in sorted(names)] for kind in
                               ("depth", "normal", "error"))  # fmt: skip
    kept = np.concatenate([depth[depth > 0] for depth in depths])
    assert len(kept) > 0.3 * sum(depth.size for depth in depths)
    assert np.median(np.abs(kept - WALL_Z)) < 0.02
    for depth, normal, error in zip(depths, normals, errors, strict=True):
        assert depth.dtype == np.float32 and depth.shape == (48, 64)
        there = depth > 0
        np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), there, atol=1e-5)
        assert (error[there] > 0).all() and (error[~there] == 0).all()


def test_the_cloud_and_the_mesh_lie_on_the_wall_in_its_colours(out):
    cloud = trimesh.load(out / "dense.ply")
    assert np.median(np.abs(cloud.vertices[:, 2] - WALL_Z)) < 0.02
    assert (np.abs(np.asarray(cloud.colors)[:, 0].astype(int) - 90) <= 1).all()  # red is 90 everywhere on the wall
    mesh = trimesh.load(out / "mesh.ply")
    assert np.median(np.abs(mesh.vertices[:, 2] - WALL_Z)) < 0.03


def test_metrics_say_how_much_was_covered_and_how_long_it_took(out):
    metrics = json.loads((out / "metrics.json").read_text())
    assert 0.3 < metrics["stereo_coverage"] <= 1 and metrics["dense_points"] > 100
    assert {"read", "points", "stereo", "mesh"} <= metrics["seconds"].keys()


def test_maps_are_what_prior_files_reads(out, wall, tmp_path, capsys):
    arguments = [f"scene.path={wall}", f"out={tmp_path / 'run'}", "points.source=file", "scene.test_every=4"]
    arguments += [f"points.file={wall / 'points.ply'}", "train.iterations=2", "prior=files", "prior.normal.source=none"]
    arguments += [f"prior.depth.path={out / 'depth'}", "prior.depth.align=false", "prior.depth.joint=false"]
    assert cli.main(["train", *arguments]) == 0
    assert "6 of 6 maps used" in capsys.readouterr().out


def test_photos_that_have_nothing_in_common_are_reported_and_leave_no_mesh(wall, tmp_path, capsys):
    """Every camera at one place: no parallax, no depth, no crash."""
    import shutil

    still = tmp_path / "still"
    shutil.copytree(wall, still)
    for pose in (still / "pose").glob("*.txt"):
        np.savetxt(pose, np.eye(4))
    out = tmp_path / "out"
    arguments = [f"scene.path={still}", f"out={out}", "points.source=file", f"points.file={wall / 'points.ply'}"]
    assert cli.main(["depth", *arguments]) == 0
    assert "stereo: 0% of the pixels" in capsys.readouterr().out
    assert not (out / "mesh.ply").exists() and (out / "dense.ply").exists()
