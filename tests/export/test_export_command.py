"""`room2dgs export` of a run of the wall: what it writes, read back by others; and what it says of bad input."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest
import torch
import trimesh

from room2dgs import cli
from room2dgs.captures.read import read_scene
from room2dgs.commands.completion_words import found_words
from room2dgs.config import load_config
from room2dgs.geometry.rotations import quaternions_to
from room2dgs.mesh.io import write_mesh
from room2dgs.registries.exporters import EXPORTERS, place_of
from room2dgs.runs.folder import write_config
from room2dgs.splat.types import Surfels
from room2dgs.train import save_surfels

WALL_Z = 2.0
TEST_EVERY = 4


@pytest.fixture(scope="module")
def run(wall, tmp_path_factory) -> Path:
    """The wall as a run would leave it, had its training been perfect; up is -y there."""
    out = tmp_path_factory.mktemp("runs") / "wall"
    out.mkdir()
    places = [f"scene.path={wall}", f"out={out}", "points.source=file", f"points.file={wall / 'points.ply'}"]
    write_config(out, load_config([*places, f"scene.test_every={TEST_EVERY}"]))
    x, y = (part.ravel() for part in np.meshgrid(np.arange(-1.3, 2.0, 0.04), np.arange(-1.0, 1.01, 0.04)))
    count = len(x)
    centers = np.stack([x, y, np.full(count, WALL_Z)], axis=1)
    surfels = Surfels(
        centers=torch.tensor(centers, dtype=torch.float32),
        rotations=torch.tensor(quaternions_to(np.tile([0, 0, 1.0], (count, 1))), dtype=torch.float32),
        scales=torch.full((count, 2), 0.04),
        opacities=torch.full((count,), 0.95),
        sh=torch.zeros(count, 1, 3),
    )
    save_surfels(out / "surfels.safetensors", surfels, {"iteration": 1})
    write_mesh(out / "mesh.ply", trimesh.load(wall / "gt_mesh.ply", process=False))
    return out


def exported(run: Path, out: Path, *wanted: str) -> Path:
    assert cli.main(["export", f"run={run}", f"to={','.join(wanted)}", f"out={out}"]) == 0
    return out


def refused(capsys, *argv: str) -> str:
    capsys.readouterr()
    assert cli.main(["export", *argv]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def cameras_of(path: Path, **settings) -> dict:
    texts = [f"scene.{key}={value}" for key, value in settings.items()]
    scene = read_scene(load_config([f"scene.path={path}", "out=unused", *texts]).scene)
    return {frame.name: frame for frame in scene.frames}


@pytest.mark.parametrize("name", ["colmap", "colmap_text", "transforms"])
def test_cameras_come_back_through_our_readers(run, wall, tmp_path, name):
    before, after = cameras_of(wall), cameras_of(exported(run, tmp_path, name) / name)
    assert len(after) == 8
    for (_, frame), key in zip(sorted(after.items()), sorted(before), strict=True):
        np.testing.assert_allclose(frame.camera.cam_from_world, before[key].camera.cam_from_world, atol=1e-9)
        np.testing.assert_allclose(frame.camera.K, before[key].camera.K, atol=1e-9)
        np.testing.assert_array_equal(frame.color(), before[key].color())  # the very file


def test_held_out_views_stay_held_out(run, tmp_path):
    meta = json.loads((exported(run, tmp_path, "transforms") / "transforms/transforms.json").read_text())
    assert len(meta["test_filenames"]) == 2 and len(meta["train_filenames"]) == 6
    assert meta["val_filenames"] == meta["test_filenames"]  # nerfstudio wants all three or none
    cloud = trimesh.load(tmp_path / "transforms" / meta["ply_file_path"])
    assert np.ptp(cloud.vertices[:, 2]) == 0 and cloud.vertices[0, 2] == WALL_Z


def test_neither_the_runs_files_nor_the_captures_are_written_over(run, wall, tmp_path, capsys):
    before = {path: path.read_bytes() for folder in (run, wall) for path in folder.rglob("*") if path.is_file()}
    assert "own folder" in refused(capsys, f"run={run}", "to=ply", f"out={run}", "faces=200")
    assert "has the capture" in refused(capsys, f"run={run}", "to=depth", f"out={wall}")
    moved = shutil.copytree(wall, tmp_path / "colmap")
    copy = shutil.copytree(run, tmp_path / "run")
    config = (copy / "config.yaml").read_text().replace(str(wall), str(moved))
    (copy / "config.yaml").write_text(config)
    assert "has the capture" in refused(capsys, f"run={copy}", "to=colmap", f"out={tmp_path}")
    assert all(path.read_bytes() == content for path, content in before.items())


def test_colmap_tracks_come_back(run, wall, tmp_path):
    from room2dgs.captures.colmap_model import read_model
    from room2dgs.captures.point_cloud import PointCloud, Tracks
    from room2dgs.export.colmap_model import colmap_model

    scene = read_scene(load_config([f"scene.path={wall}", "out=unused"]).scene)
    first, second = (frame for frame in scene.frames[:2])
    xyz = np.array([[0.2, 0.1, 2.0], [0.3, -0.2, 2.0]])
    pixel = np.concatenate([first.camera.project(xyz)[0], second.camera.project(xyz)[0]]).astype(np.float32)
    frame, point = np.array([0, 0, 1, 1], np.int32), np.array([1, 0, 0, 1], np.int32)
    pixel = pixel[[1, 0, 2, 3]]
    tracks = Tracks((first.name, second.name), frame, point, pixel)
    points = PointCloud(xyz, np.array([[10, 20, 30], [40, 50, 60]], np.uint8), tracks)
    model = colmap_model(scene, points, {one.name: f"{one.name}.png" for one in scene.frames})
    model.write_binary(tmp_path)
    found = read_model(tmp_path).points()
    np.testing.assert_allclose(found.xyz, xyz)
    assert found.rgb.tolist() == [[10, 20, 30], [40, 50, 60]]
    assert model.compute_mean_reprojection_error() < 1e-4
    assert sorted(zip(found.point.tolist(), found.pixel[:, 0].round(3).tolist(), strict=True)) == sorted(
        zip(point.tolist(), pixel[:, 0].astype(float).round(3).tolist(), strict=True)
    )


def test_a_model_that_could_not_be_written_whole_is_not_there(run, tmp_path, monkeypatch):
    def full(model, folder):
        (folder / "cameras.bin").write_bytes(b"half of")
        raise OSError("no space left on device")

    monkeypatch.setattr(pycolmap.Reconstruction, "write_binary", full)
    assert cli.main(["export", f"run={run}", "to=colmap", f"out={tmp_path}"]) != 0
    assert not list((tmp_path / "colmap" / "sparse").iterdir())


def test_depth_and_normals_are_those_of_the_wall(run, tmp_path):
    exported(run, tmp_path, "depth", "depth_npy", "normals", "normals_npy")
    png = cv2.imread(str(tmp_path / "depth/000003.png"), cv2.IMREAD_UNCHANGED)
    assert png.dtype == np.uint16 and np.median(png) == 2000
    assert np.median(np.load(tmp_path / "depth_npy/000003.npy")) == pytest.approx(WALL_Z, abs=1e-4)
    normal = np.load(tmp_path / "normals_npy/000003.npy")
    np.testing.assert_allclose(np.median(normal, axis=(0, 1)), [0, 0, -1], atol=1e-3)
    levels = cv2.imread(str(tmp_path / "normals/000003.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert np.median(levels, axis=(0, 1)).tolist() == pytest.approx([32768, 32768, 0], abs=40)
    cameras = json.loads((tmp_path / "depth/cameras.json").read_text())
    assert len(cameras) == 8 and cameras["000003"]["cam_from_world"][0][3] == pytest.approx(-0.3)


def test_splats_are_turned_as_asked_and_points_never(run, tmp_path):
    for up, third in (("-y", WALL_Z), ("keep", WALL_Z), ("y", -WALL_Z)):
        out = tmp_path / up
        assert cli.main(["export", f"run={run}", "to=splat,points", f"out={out}", f"up={up}"]) == 0
        rows = np.frombuffer((out / "splats.splat").read_bytes(), np.uint8).reshape(-1, 32)
        assert np.unique(rows[:, 8:12].copy().view("<f4")).tolist() == [third]
        cloud = trimesh.load(out / "points.ply")
        assert np.unique(cloud.vertices[:, 2]).tolist() == [WALL_Z]
    head = (tmp_path / "y/points.ply").read_bytes()[:400]
    assert b"property float nz" in head and b"property float confidence" in head


def test_inria_folder_is_in_the_world_of_its_cameras(run, tmp_path):
    folder = exported(run, tmp_path, "inria") / "inria"
    (cloud,) = folder.glob("point_cloud/iteration_*/point_cloud.ply")
    head, _, body = cloud.read_bytes().partition(b"end_header\n")
    names = [line.split()[2].decode() for line in head.splitlines() if line.startswith(b"property")]
    rows = np.frombuffer(body, "<f4").reshape(-1, len(names))
    assert sum(name.startswith("f_rest") for name in names) == 45
    assert np.unique(rows[:, names.index("z")]).tolist() == [WALL_Z]
    cameras = json.loads((folder / "cameras.json").read_text())
    assert cameras[3]["position"] == pytest.approx([0.3, 0, 0]) and cameras[3]["img_name"] == "000003"


def test_stl_usdz_and_the_page_of_splats_are_of_the_run(run, tmp_path):
    wanted = ["to=stl,usdz,html", f"out={tmp_path}", "export.texture_px=256"]
    assert cli.main(["export", f"run={run}", *wanted]) == 0
    assert len(trimesh.load(tmp_path / "mesh.stl").faces) == len(trimesh.load(run / "mesh.ply").faces)
    with zipfile.ZipFile(tmp_path / "room.usdz") as package:
        assert package.namelist() == ["room.usda", "textures/room.jpg"]
    text = (tmp_path / "splats.html").read_text(encoding="utf-8")
    assert "<title>wall</title>" in text and str(run.parent) not in text


def test_faces_are_few_where_few_are_wanted(run, tmp_path):
    assert cli.main(["export", f"run={run}", "to=ply", f"out={tmp_path}", "faces=200"]) == 0
    assert len(trimesh.load(tmp_path / "mesh.ply").faces) <= 200
    assert len(trimesh.load(run / "mesh.ply").faces) > 1000


def test_no_two_formats_have_the_same_place_and_each_can_be_loaded():
    assert len({place_of(one) for one in EXPORTERS.entries()}) == len(EXPORTERS)
    assert all(callable(one.load()) for one in EXPORTERS.entries())
    quick = [one.name for one in EXPORTERS.entries() if one.facts.get("after_run")]
    assert quick == ["splats", "splats_2dgs", "splat", "spz", "glb"]


def test_a_format_of_another_package_is_written_listed_and_completed(run, tmp_path, capsys, monkeypatch):
    """A package's file that registers an exporter, found as pip would leave it."""
    (tmp_path / "site").mkdir()
    (tmp_path / "site/x3d_of_rooms.py").write_text(
        "def write(source, path):\n"
        "    path.parent.mkdir(parents=True, exist_ok=True)\n"
        "    path.write_text(f'{len(source.mesh.faces)} faces')\n"
        "    return [path]\n"
    )
    info = tmp_path / "site/x3d_of_rooms-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: x3d-of-rooms\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[room2dgs.exporters]\nx3d = x3d_of_rooms:write\n")
    monkeypatch.syspath_prepend(tmp_path / "site")
    assert cli.main(["export", f"run={run}", "to=x3d", f"out={tmp_path / 'out'}"]) == 0
    assert (tmp_path / "out/x3d").read_text() == f"{len(trimesh.load(run / 'mesh.ply').faces)} faces"
    assert cli.main(["export", "--help"]) == 0
    assert "Comes from the installed package x3d-of-rooms." in capsys.readouterr().out
    assert "x3d" in found_words().values[("export", "to")]


def test_what_cannot_be_exported_is_said_in_a_sentence(run, tmp_path, capsys):
    out = tmp_path / "out"
    assert "run=DIR" in refused(capsys, "to=spz")
    assert "holds no run" in refused(capsys, f"run={tmp_path}", "to=spz")
    assert "splats_2dgs" in refused(capsys, f"run={run}", f"out={out}")
    assert "'x3d'" in refused(capsys, f"run={run}", "to=spz,x3d", f"out={out}")
    assert "export.faces=3" in refused(capsys, f"run={run}", "to=glb", "faces=3", f"out={out}")
    bare = Path(shutil.copytree(run, tmp_path / "bare"))
    (bare / "mesh.ply").unlink()
    assert "room2dgs mesh" in refused(capsys, f"run={bare}", "to=spz,glb", f"out={out}")
    assert not out.exists()
