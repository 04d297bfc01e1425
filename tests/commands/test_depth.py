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
    more = ["mesh.max_error_m=null", "mesh.voxel_m=0.04", "mesh.min_triangles=10", "scene.test_every=4"]
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


def test_half_the_photos_as_keyframes_are_compared_with_all(wall, tmp_path):
    out = tmp_path / "out"
    arguments = [f"scene.path={wall}", f"out={out}", "points.source=file", f"points.file={wall / 'points.ply'}"]
    more = ["mesh.max_error_m=null", "mesh.voxel_m=0.04", "mesh.min_triangles=10", "scene.test_every=4"]
    assert cli.main(["depth", *arguments, *more, "scene.keyframes=0.5"]) == 0
    depths = [np.load(path) for path in (out / "depth").glob("*.npy")]
    assert len(depths) == 3
    kept = np.concatenate([depth[depth > 0] for depth in depths])
    assert len(kept) > 0.3 * sum(depth.size for depth in depths)
    assert np.median(np.abs(kept - WALL_Z)) < 0.02
    photos = json.loads((out / "coverage.json").read_text())["photos"]
    assert len(photos) == 3


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


def test_coverage_counts_what_the_maps_hold(out):
    coverage = json.loads((out / "coverage.json").read_text())
    assert len(coverage["photos"]) == 6
    for photo in coverage["photos"]:
        num_consistent = np.load(out / "num_consistent" / f"{photo['photo']}.npy")
        error = np.load(out / "error" / f"{photo['photo']}.npy")
        assert photo["stereo"] == pytest.approx(np.mean(np.load(out / "depth" / f"{photo['photo']}.npy") > 0))
        for count, share in photo["num_consistent"].items():
            assert share == pytest.approx(np.mean(num_consistent == int(count)))
        assert sum(photo["num_consistent"].values()) == pytest.approx(photo["stereo"])
        assert photo["error_m"] == pytest.approx(np.median(error[error > 0]))
        assert photo["filled"] is None
    assert coverage["total"]["stereo"] == pytest.approx(np.mean([photo["stereo"] for photo in coverage["photos"]]))
    assert coverage["seconds"]["stereo"]["wall"] > 0 and coverage["seconds"]["stereo"]["cpu"] > 0


def test_the_page_says_the_same_and_needs_no_network(out):
    text = (out / "report.html").read_text(encoding="utf-8")
    total = json.loads((out / "coverage.json").read_text())["total"]
    assert f"<td>stereo's depth in all</td>\n      <td>{total['stereo']:.1%}</td>" in text.replace("&#39;", "'")
    assert text.count("<figure>") == 6 * 3 and text.count('src="data:image/jpeg') == 6 * 3
    assert "default-src 'none'" in text and "http://" not in text and "https://" not in text


@pytest.mark.slow
def test_what_stereo_leaves_empty_is_filled_on_demand(out, wall, tmp_path, capsys):
    """A prior 10 % too far, of half of each photo: drawn to the stereo around it, and counted where stereo is not."""
    (tmp_path / "prior").mkdir()
    half = np.zeros((48, 64), np.float32)
    half[:, 32:] = 1.1 * WALL_Z
    for photo in (wall / "color").iterdir():
        np.save(tmp_path / "prior" / f"{photo.stem}.npy", half)
    arguments = [f"scene.path={wall}", f"out={tmp_path / 'out'}", "points.source=file", "scene.test_every=4"]
    arguments += [f"points.file={wall / 'points.ply'}", "mesh.voxel_m=0.04", "mesh.min_triangles=10", "fill=true"]
    arguments += ["prior=files", f"prior.depth.path={tmp_path / 'prior'}", "prior.normal.source=none"]
    assert cli.main(["depth", *arguments]) == 0
    coverage = json.loads((tmp_path / "out" / "coverage.json").read_text())
    assert {"stereo", "maps", "joint", "completion", "mesh"} <= coverage["seconds"].keys()
    for photo in coverage["photos"]:
        filled = np.load(tmp_path / "out" / "filled" / f"{photo['photo']}.npy")
        sure = np.load(tmp_path / "out" / "filled_confidence" / f"{photo['photo']}.npy")
        added = (filled > 0) & (np.load(out / "depth" / f"{photo['photo']}.npy") == 0)
        assert photo["filled"] == pytest.approx(added.mean()) and photo["filled"] <= 0.5
        assert photo["filled_sure"] == pytest.approx((added & (sure >= 0.5)).mean())
        assert np.median(np.abs(filled[filled > 0] - WALL_Z)) < 0.02
    assert "were filled" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_fill_takes_true_or_false_alone(wall, tmp_path, capsys):
    assert cli.main(["depth", f"scene.path={wall}", f"out={tmp_path / 'out'}", "fill=yes"]) == 2
    assert "fill=yes" in capsys.readouterr().err and not (tmp_path / "out").exists()
