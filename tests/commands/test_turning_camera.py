"""A camera that only turned: photos tell no depth, so that the prior's counts alone, unless photos contradict poses."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.sfm.sparse import MayLack, sparse_points

EYE = np.array([1.9, 2.1, 1.3])
K = np.array([[260, 0, 159.5, 0], [0, 260, 119.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
VIEWS = 8


def write_capture(folder, views):
    """(world_from_cam, photo) of each frame, in ScanNet's layout."""
    for name in ("color", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", K)
    for index, (pose, photo) in enumerate(views):
        cv2.imwrite(str(folder / f"color/{index}.png"), photo)
        np.savetxt(folder / f"pose/{index}.txt", pose, fmt="%.12f")
    return folder


def true_depth(pose):
    """(240, 320) of the corner's three planes x = 0, y = 0, z = 0."""
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    rays = np.stack([(x - K[0, 2]) / 260, (y - K[1, 2]) / 260, np.ones(x.shape)], axis=-1) @ pose[:3, :3].T
    return np.where(rays < -1e-6, -pose[:3, 3] / np.minimum(rays, -1e-6), np.inf).min(axis=-1).astype(np.float32)


def write_wrongly_turned(folder, views):
    """Each pose turned to the side by a part of what lies between two photos, the other way round every second time."""
    wrong = []
    for index, (pose, photo) in enumerate(views):
        turned = pose.copy()
        turned[:3, :3] = cv2.Rodrigues(np.array([0, 0, 0.03 * (-1) ** index]))[0] @ pose[:3, :3]
        wrong.append((turned, photo))
    return write_capture(folder, wrong)


@pytest.fixture(scope="module")
def views(corner_walk):
    angles = np.radians(np.linspace(200, 250, VIEWS))
    targets = [EYE + np.array([np.cos(a), np.sin(a), -0.5]) for a in angles]
    return corner_walk([EYE] * VIEWS, targets)


@pytest.fixture(scope="module")
def turning(views, tmp_path_factory):
    folder = tmp_path_factory.mktemp("turning")
    write_capture(folder / "capture", views)
    (folder / "maps").mkdir()
    for index, (pose, _) in enumerate(views):
        np.save(folder / f"maps/{index}.npy", true_depth(pose))
    return folder


def points_of(folder, cache, may_lack=MayLack.WITH_METRES):
    config = load_config([f"scene.path={folder}", "out=unused", "points.max_features=1000"])
    log = []
    found = sparse_points(read_scene(config.scene), config.points, cache, log.append, may_lack)
    return found, "\n".join(log)


def settings(turning, out):
    given = [f"scene.path={turning / 'capture'}", f"out={out}", "scene.test_every=0", "scene.image_width=160"]
    priors = ["prior=files", f"prior.depth.path={turning / 'maps'}", "prior.normal.source=none"]
    return [*given, *priors, "prior.depth.joint=false", "mesh.voxel_m=0.04", "mesh.min_triangles=10"]


def test_photos_that_agree_with_the_rotations_are_no_reason_to_stop(turning, tmp_path):
    points, said = points_of(turning / "capture", tmp_path)
    assert len(points) == 0 and not len(points.tracks)
    assert "WARNING" in said and "was taken from one place" in said and "the prior's alone" in said
    with pytest.raises(InputError, match=r"was taken from one place.*walk while filming"):
        points_of(turning / "capture", tmp_path, may_lack=MayLack.NEVER)


def test_rotations_that_the_photos_contradict_stop_the_run(views, tmp_path):
    write_wrongly_turned(tmp_path / "capture", views)
    with pytest.raises(InputError, match=r"poses that its photos contradict.*check that they belong"):
        points_of(tmp_path / "capture", tmp_path / "cache")
    assert list((tmp_path / "cache").iterdir()) == []


def test_photos_with_parallax_are_not_taken_for_a_rotation(corner_views, tmp_path):
    """Poses that say one place, of photos that were taken along an arc."""
    wrong = [(np.block([[pose[:3, :3], EYE[:, None]], [np.eye(4)[3:]]]), photo) for pose, photo, _ in corner_views]
    write_capture(tmp_path / "capture", wrong)
    with pytest.raises(InputError, match="poses that its photos contradict"):
        points_of(tmp_path / "capture", tmp_path / "cache")


def test_steps_too_small_for_points_are_no_contradiction(views, corner_walk, tmp_path):
    """Half a centimetre from photo to photo, while the camera turns."""
    eyes = [EYE + np.array([0.005 * (index % 2), 0, 0]) for index in range(VIEWS)]
    targets = [eye + pose[:3, 2] for eye, (pose, _) in zip(eyes, views, strict=True)]
    write_capture(tmp_path / "capture", corner_walk(eyes, targets))
    points, said = points_of(tmp_path / "capture", tmp_path / "cache")
    assert len(points) == 0 and "WARNING" in said


@pytest.mark.slow
def test_a_run_goes_on_with_the_priors_metres(turning, tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["run", *settings(turning, out), "mesh.source=depth", "report.enabled=false"]) == 0
    corners = trimesh.load(out / "mesh.ply").vertices
    assert np.median(np.abs(corners).min(axis=1)) < 0.01
    assert json.loads((out / "metrics.json").read_text())["points"] == 0
    assert "WARNING" in (out / "log.txt").read_text()


@pytest.mark.slow
def test_training_begins_on_the_priors_surface(turning, tmp_path):
    out = tmp_path / "out"
    more = ["train.iterations=3", "train.tensorboard=false"]
    assert cli.main(["train", *settings(turning, out), *more]) == 0
    assert json.loads((out / "metrics.json").read_text())["seeds"] > 100


def test_without_a_prior_one_sentence_says_what_to_do(turning, tmp_path, capsys):
    arguments = [f"scene.path={turning / 'capture'}", f"out={tmp_path / 'out'}", "points.max_features=1000"]
    assert cli.main(["train", *arguments, "prior=none"]) == 2
    said = capsys.readouterr().err
    assert "was taken from one place" in said and "prior=room_prior" in said and "Traceback" not in said
    assert not (tmp_path / "out").exists()


def depth_of(capture, out, *more):
    """Exit code of `room2dgs depth`."""
    small = ["scene.test_every=0", "scene.image_width=160", "points.max_features=1000", "mesh.voxel_m=0.04"]
    return cli.main(["depth", f"scene.path={capture}", f"out={out}", *small, "mesh.min_triangles=10", *more])


def test_depth_of_a_turning_camera_is_empty_and_says_so(turning, tmp_path, capsys):
    out = tmp_path / "out"
    assert depth_of(turning / "capture", out) == 0
    log = (out / "log.txt").read_text()
    assert log.count("WARNING") == 1 and "stereo: 0% of the pixels of 8 views" in log
    coverage = json.loads((out / "coverage.json").read_text())
    assert coverage["total"]["stereo"] == 0 and coverage["total"]["error_m"] is None
    assert [photo["stereo"] for photo in coverage["photos"]] == [0] * VIEWS
    for kind in ("depth", "normal", "error", "num_consistent"):
        maps = [np.load(path) for path in (out / kind).glob("*.npy")]
        assert len(maps) == VIEWS and not any(one.any() for one in maps)
    assert (out / "dense.ply").exists() and not (out / "mesh.ply").exists()
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "was taken from one place" in page and "fill=true" in page


def test_depth_of_poses_that_photos_contradict_stops_and_leaves_nothing(views, tmp_path, capsys):
    write_wrongly_turned(tmp_path / "capture", views)
    assert depth_of(tmp_path / "capture", tmp_path / "out") == 2
    assert "poses that its photos contradict" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_depth_of_photos_with_nothing_in_common_stops(views, tmp_path, capsys):
    """Cameras far apart, blank photos: no points, but not of one place."""
    blank = [(pose.copy(), np.full_like(photo, 128)) for pose, photo in views]
    for index, (pose, _) in enumerate(blank):
        pose[0, 3] += 0.2 * index
    write_capture(tmp_path / "capture", blank)
    assert depth_of(tmp_path / "capture", tmp_path / "out") == 2
    assert "add sharp overlapping photos" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_too_little_depth_for_a_mesh_is_a_warning(turning, tmp_path, capsys):
    """All of the prior's depth is farther than may be fused: maps and report are there, the mesh is not."""
    out = tmp_path / "out"
    prior = ["prior=files", f"prior.depth.path={turning / 'maps'}", "prior.normal.source=none", "fill=true"]
    assert depth_of(turning / "capture", out, *prior, "mesh.max_depth_m=0.2") == 0
    warning = "no mesh: no pixel of the depth maps may be fused"
    assert f"WARNING: {warning}" in (out / "log.txt").read_text()
    assert warning in (out / "report.html").read_text(encoding="utf-8") and not (out / "mesh.ply").exists()
    assert json.loads((out / "coverage.json").read_text())["total"]["filled"] > 0.99


@pytest.mark.slow
def test_filled_depth_of_a_turning_camera_is_the_priors(turning, tmp_path):
    out = tmp_path / "out"
    prior = ["prior=files", f"prior.depth.path={turning / 'maps'}", "prior.normal.source=none"]
    assert depth_of(turning / "capture", out, "fill=true", *prior) == 0
    total = json.loads((out / "coverage.json").read_text())["total"]
    assert total["stereo"] == 0 and total["filled"] > 0.99
    assert np.median(np.abs(trimesh.load(out / "mesh.ply").vertices).min(axis=1)) < 0.01
