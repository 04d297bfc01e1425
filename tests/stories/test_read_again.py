"""What one command writes, another reads: captures of exports, maps of `depth` and of exports as priors."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Scene
from room2dgs.config import load_config
from room2dgs.mesh.io import read_mesh


def scene_of(path: Path, *more: str) -> Scene:
    return read_scene(load_config([f"scene.path={path}", "out=unused", "scene.test_every=0", *more]).scene)


def assert_same_views(one: Scene, other: Scene) -> None:
    """In poses, intrinsics, photos and masks."""
    assert len(one.frames) == len(other.frames)
    for a, b in zip(one.frames, other.frames, strict=True):
        assert a.camera.size == b.camera.size
        np.testing.assert_allclose(a.camera.K, b.camera.K, atol=1e-6)
        np.testing.assert_allclose(a.camera.cam_from_world, b.camera.cam_from_world, atol=1e-6)
        grey = [cv2.cvtColor(one.color(), cv2.COLOR_RGB2GRAY).astype(int) for one in (a, b)]
        assert np.abs(grey[0] - grey[1]).mean() < 5  # a resized photo becomes JPEG
        masks = a.mask(), b.mask()
        assert all(mask is None for mask in masks) or np.array_equal(*masks)


FORMATS = ("colmap", "colmap_text", "transforms")


def write_colmap(room: Path, root: Path) -> Path:
    """The room as two cameras whose photos have the same names in their folders."""
    (root / "sparse/0").mkdir(parents=True)
    lines = []
    for number in range(6):
        name = f"cam{number % 2}/{number // 2:04d}.png"
        (root / "images" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(room / f"color/{number}.png", root / "images" / name)
        pose = np.linalg.inv(np.loadtxt(room / f"pose/{number}.txt"))
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        numbers = " ".join(map(str, (w, x, y, z, *pose[:3, 3])))
        lines.append(f"{number + 1} {numbers} 1 {name}\n\n")
    (root / "sparse/0/cameras.txt").write_text("1 PINHOLE 80 60 65 65 40 30\n")
    (root / "sparse/0/images.txt").write_text("".join(lines))
    (root / "sparse/0/points3D.txt").write_text("")
    return root


@pytest.fixture(scope="module")
def exported(room, tmp_path_factory, story):
    """(the scene of a run, the run's folder) of narrow photos with masks, in half metres, and all its exports."""
    root = tmp_path_factory.mktemp("again")
    capture, out = write_colmap(room, root / "capture"), root / "run"
    for number in range(6):
        white = np.full((60, 80), 255, np.uint8)
        white[:, : 8 * (number // 2)] = 0
        white[20:40, 60:] = 0
        path = capture / f"masks/cam{number % 2}/{number // 2:04d}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), white)
    given = ["scene.image_width=40", "scene.unit=0.5", "seeds.voxel_m=0.05", "mesh.voxel_m=0.04"]
    points = root / "points.ply"  # in metres, as everything that a run is given
    cloud = np.asarray(trimesh.load(room / "points.ply").vertices) * 0.5
    trimesh.PointCloud(cloud).export(points)
    story.told(*story.settings(capture, out), *given, f"points.file={points}")
    story.told("mesh", f"run={out}")
    story.told("render", f"run={out}", "views=all")
    story.told("export", f"run={out}", f"to={','.join(FORMATS)},depth_npy")
    return scene_of(capture, *given[:2]), out


@pytest.mark.parametrize("name", FORMATS)
def test_an_export_is_the_capture_that_the_run_worked_with(exported, name):
    """In metres, at the run's size, with what its masks hide."""
    scene, out = exported
    again = scene_of(out / "export" / name)
    assert scene.frames[0].camera.size == again.frames[0].camera.size == (40, 30)
    assert all(frame.mask() is not None for frame in again.frames)
    assert_same_views(scene, again)


def test_a_run_with_masks_draws_all_of_its_views(exported):
    _, out = exported
    drawn = [path for kind in ("test", "train") for path in (out / "renders" / kind).glob("*.png")]
    assert len(drawn) == 6
    for path in drawn:
        colour = cv2.imread(str(path))[:, 40:80]
        assert (colour.max(axis=-1) > 20).mean() > 0.9  # where a mask hid the photo, too


def test_a_run_of_an_export_finds_the_room_where_the_first_did(exported, story, tmp_path):
    _, out = exported
    given = story.settings(out / "export/colmap", tmp_path / "again")
    points = f"points.file={out / 'export/transforms/sparse_points.ply'}"
    story.told(*given, points, "seeds.voxel_m=0.05", "mesh.voxel_m=0.04")
    first, second = (read_mesh(run / "mesh.ply").bounds for run in (out, tmp_path / "again"))
    assert np.abs(first - second).max() < 0.2
    assert np.ptp(first, axis=0).max() < 1.6  # half a metre a unit


def test_depth_of_an_export_is_a_prior_of_the_next_run(exported, story, tmp_path):
    _, out = exported
    given = story.settings(out / "export/colmap", tmp_path / "next")
    given = [text for text in given if not text.startswith(("points.", "prior="))]
    more = ["prior/depth=files", f"prior.depth.path={out / 'export/depth_npy'}", "prior.depth.align=false"]
    more += ["prior/normal=none", "seeds.voxel_m=0.05"]
    story.told(*given, *more, "mesh.voxel_m=0.04", "stereo.enabled=false")
    found = story.metrics(tmp_path / "next")
    assert found["depth_source"] == "files"
    assert np.abs(read_mesh(tmp_path / "next/mesh.ply").bounds - read_mesh(out / "mesh.ply").bounds).max() < 0.2


def test_depth_of_two_cameras_is_the_prior_of_their_run(room, story, tmp_path):
    two_folders = write_colmap(room, tmp_path / "capture")
    given = [f"scene.path={two_folders}", "points.source=file", f"points.file={room / 'points.ply'}"]
    quick = ["mesh.voxel_m=0.06", "mesh.min_triangles=1", "mesh.max_error_m=null", "report.enabled=false"]
    maps, out = tmp_path / "maps", tmp_path / "run"
    story.told("depth", *given, *quick, f"out={maps}", "scene.test_every=0")
    frames = scene_of(two_folders).frames
    assert {path.stem for path in (maps / "depth").iterdir()} == {frame.name for frame in frames}
    assert len(frames) == 6
    files = ["prior/depth=files", f"prior.depth.path={maps / 'depth'}", "prior/normal=none"]
    run = [text for text in story.settings(two_folders, out) if not text.startswith(("points.", "prior="))]
    story.told(*run, *given[1:], *quick, *files, "prior.depth.align=false", "stereo.enabled=false")
    assert story.metrics(out)["depth_source"] == "files"
    truth = f"eval.gt={room / 'gt_mesh.ply'}"
    story.told("eval", f"run={out}", truth)
    assert story.metrics(out)["f_score_5cm"] > 0.8
