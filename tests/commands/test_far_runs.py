"""A capture at UTM coordinates gives the mesh, the scores and the files of the same capture at the origin."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
import torch
import trimesh

from room2dgs import cli, open_run
from room2dgs.geometry.rotations import quaternions_to
from room2dgs.mesh.io import read_mesh, write_mesh
from room2dgs.registries.exporters import EXPORTERS
from room2dgs.splat.types import Surfels
from room2dgs.train import save_surfels

OFFSET = np.array([500000.0, 5400000.0, 300.0])  # whole: the scene's frame is then the same to the bit
WALL_Z = 2.0


def far_away(wall, folder, offset):
    """The capture elsewhere in the world."""
    shutil.copytree(wall, folder)
    for path in (folder / "pose").iterdir():
        pose = np.loadtxt(path)
        pose[:3, 3] += offset
        np.savetxt(path, pose)
    mesh = trimesh.load(wall / "gt_mesh.ply", process=False)
    mesh.apply_translation(offset)
    write_mesh(folder / "gt_mesh.ply", mesh)
    points = np.asarray(trimesh.load(wall / "points.ply").vertices, np.float64) + offset
    head = [f"element vertex {len(points)}", *(f"property double {axis}" for axis in "xyz"), "end_header"]
    rows = [" ".join(f"{value:.6f}" for value in row) for row in points]
    (folder / "points.ply").write_text("\n".join(["ply", "format ascii 1.0", *head, *rows, ""]))
    return folder


def surfels_of_wall() -> Surfels:
    x, y = (part.ravel() for part in np.meshgrid(np.arange(-1.3, 2.0, 0.08), np.arange(-1.0, 1.01, 0.08)))
    normals = np.tile([0, 0, 1.0], (len(x), 1))
    return Surfels(
        centers=torch.tensor(np.stack([x, y, np.full(len(x), WALL_Z)], axis=1), dtype=torch.float32),
        rotations=torch.tensor(quaternions_to(normals), dtype=torch.float32),
        scales=torch.full((len(x), 2), 0.08),
        opacities=torch.full((len(x),), 0.95),
        sh=torch.zeros(len(x), 1, 3),
    )


@pytest.fixture(scope="module")
def runs(wall, tmp_path_factory):
    """(near, far) folders of runs of the points' surface, with surfels as if they had been trained."""
    root = tmp_path_factory.mktemp("far")
    captures = {
        name: far_away(wall, root / f"{name}_capture", by) for name, by in (("near", 0 * OFFSET), ("far", OFFSET))
    }
    for name, capture in captures.items():
        given = [f"scene.path={capture}", f"out={root / name}", "points.source=file"]
        given += [f"points.file={capture / 'points.ply'}", "sfm.refine_poses=false", "prior=none"]
        given += ["mesh.source=points", "mesh.voxel_m=0.05", "mesh.min_triangles=10", "eval.samples=2000"]
        assert cli.main(["run", *given]) == 0
        save_surfels(root / name / "surfels.safetensors", surfels_of_wall(), {"iteration": 1})
    return root / "near", root / "far"


def metrics(run) -> dict:
    return json.loads((run / "metrics.json").read_text())


def test_the_mesh_and_its_scores_are_the_same_elsewhere(runs):
    near, far = (read_mesh(run / "mesh.ply") for run in runs)
    assert np.array_equal(near.faces, far.faces)
    assert np.abs(far.vertices - near.vertices - OFFSET).max() < 1e-5  # steps of near's float32
    before, after = map(metrics, runs)
    assert before["capture"]["origin_m"] == [0, 0, 0] and after["capture"]["origin_m"] == OFFSET.tolist()
    for key in ("f_score_5cm", "accuracy_m", "completion_m", "normal_consistency"):
        assert after[key] == pytest.approx(before[key], abs=1e-5)
    assert before["f_score_5cm"] > 0.9
    assert "(500,000, 5,400,000, 300) m" in (runs[1] / "log.txt").read_text()
    assert "coordinates:" not in (runs[0] / "log.txt").read_text()


def test_python_has_mesh_surfels_and_cameras_of_both_in_one_frame(runs):
    near, far = map(open_run, runs)
    assert near.origin_m == (0, 0, 0) and far.origin_m == tuple(OFFSET)
    assert np.allclose(far.mesh.vertices, near.mesh.vertices, atol=1e-5)
    assert np.allclose(far.mesh.vertices + far.origin_m, read_mesh(runs[1] / "mesh.ply").vertices)
    for run in (near, far):
        seen = [np.abs(camera.centre[:2]).max() for camera in run.cameras.values()]
        assert max(seen) < 1 and abs(np.median(run.mesh.vertices[:, 2]) - WALL_Z) < 0.02


def test_the_mesh_of_the_error_lies_on_the_mesh(runs):
    error = read_mesh(runs[1] / "eval/error.ply")
    assert np.abs(error.vertices - read_mesh(runs[1] / "mesh.ply").vertices).max() < 1e-6
    page = (runs[1] / "report.html").read_text()
    assert 'data-layer="error"' in page


def test_an_offset_of_centimetres_keeps_the_wall_flat(wall, tmp_path):
    offset = np.array([500000.13, 5400000.37, 300.21])
    capture = far_away(wall, tmp_path / "capture", offset)
    given = [f"scene.path={capture}", f"out={tmp_path / 'out'}", "points.source=file", "report.enabled=false"]
    given += [f"points.file={capture / 'points.ply'}", "sfm.refine_poses=false", "prior=none", "mesh.source=points"]
    assert cli.main(["run", *given, "mesh.voxel_m=0.05", "mesh.min_triangles=10", "eval.samples=500"]) == 0
    mesh = read_mesh(tmp_path / "out/mesh.ply")
    off = mesh.vertices[:, 2] - offset[2] - WALL_Z
    assert np.abs(off).max() < 0.015  # rims bend so far near the origin too; float32 there has steps of half a metre


def test_any_mesh_is_scored_where_it_stands(runs, tmp_path, capsys):
    before, after = runs
    out = {}
    for run in runs:
        capture = re.search(r"path: (.*)", (run / "config.yaml").read_text())[1]
        out[run] = tmp_path / run.name
        given = [f"pred={run / 'mesh.ply'}", f"gt={capture}/gt_mesh.ply", f"scene={capture}", "eval.samples=2000"]
        assert cli.main(["eval", *given, f"out={out[run]}"]) == 0
    near, far = metrics(out[before]), metrics(out[after])
    assert near["f_score_5cm"] > 0.9 and far["f_score_5cm"] == pytest.approx(near["f_score_5cm"], abs=1e-5)


def test_a_mesh_near_the_origin_is_aligned_to_a_truth_far_away(runs, tmp_path):
    (near, far), out = runs, tmp_path / "out"
    captures = [re.search(r"path: (.*)", (run / "config.yaml").read_text())[1] for run in runs]
    given = [f"pred={near / 'mesh.ply'}", f"gt={captures[1]}/gt_mesh.ply", f"scene={captures[0]}", f"out={out}"]
    more = ["eval.align=icp", f"eval.align_scene={captures[1]}", "eval.samples=2000", "eval.align_scale=false"]
    assert cli.main(["eval", *given, *more]) == 0
    found = metrics(out)
    assert found["f_score_5cm"] > 0.9
    moved = np.array(found["align"]["truth_from_pred"]) @ [0, 0, WALL_Z, 1]
    assert abs(moved[2] - OFFSET[2] - WALL_Z) < 0.01
    error = read_mesh(out / "eval/error.ply")
    assert np.abs(error.vertices.mean(axis=0) - read_mesh(far / "mesh.ply").vertices.mean(axis=0)).max() < 0.2


@pytest.fixture(scope="module")
def exports(runs, tmp_path_factory):
    """(near, far) folders of exports of every format."""
    found = []
    for run in runs:
        out = tmp_path_factory.mktemp("exports") / run.name
        names = [name for name in EXPORTERS if not name.startswith("textured")]
        given = ["mesh.source=surfels", "points.source=file", "export.up=-y"]
        assert cli.main(["export", f"run={run}", f"to={','.join(names)}", f"out={out}", *given]) == 0
        found.append(out)
    return found


def cameras_json(out) -> dict:
    return next(iter(json.loads((out / "depth/cameras.json").read_text()).values()))


UP = np.array([OFFSET[0], -OFFSET[1], -OFFSET[2]])  # y up: x, -y, -z


@pytest.mark.parametrize(
    ("file", "offset"), [("mesh.ply", OFFSET), ("mesh.obj", UP), ("mesh.glb", UP), ("points.ply", OFFSET)]
)
def test_meshes_and_points_are_put_back_to_the_millimetre(exports, file, offset):
    near, far = (
        np.asarray(trimesh.load(out / file, process=False, force="mesh" if "mesh" in file else None).vertices)
        for out in exports
    )
    assert np.ptp(far, axis=0) == pytest.approx(np.ptp(near, axis=0), abs=1e-5)
    assert np.abs(far - near - offset).max() < 1e-5


def test_a_glb_keeps_its_vertices_small_and_says_where_it_stands(exports):
    data = (exports[1] / "mesh.glb").read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    (node,) = (node for node in tree["nodes"] if "mesh" in node)
    assert node["translation"] == node["extras"]["offset_m"] == UP.tolist()
    assert max(map(abs, (value for one in tree["accessors"] for value in one.get("max", ())))) < 1e6
    assert b"translation" not in (exports[0] / "mesh.glb").read_bytes()


@pytest.mark.parametrize("file", ["splats.ply", "splats_2dgs.ply", "splats.splat", "splats.spz"])
def test_splats_stay_near_and_what_to_add_stands_beside_them(exports, file):
    near, far = ((out / file).read_bytes() for out in exports)
    if file.endswith(".ply"):
        assert f"comment offset {OFFSET[0]:g} ".encode() in far and b"comment offset" not in near
        near, far = (data.partition(b"end_header\n")[2] for data in (near, far))
    assert near == far
    about = json.loads((exports[1] / f"{file}.offset.json").read_text())
    turned = np.array(about["file_from_world"]) @ OFFSET
    assert about["offset_m"] == pytest.approx(turned, abs=1e-6) and about["origin_m"] == OFFSET.tolist()
    assert not (exports[0] / f"{file}.offset.json").exists()


def test_cameras_and_their_points_are_put_back(exports):
    near, far = ({}, {})
    for out, found in zip(exports, (near, far), strict=True):
        for line in (out / "colmap_text/sparse/0/images.txt").read_text().splitlines():
            words = line.split()
            if len(words) == 10 and not line.startswith("#"):
                found[words[9]] = np.array(words[5:8], float)  # not turned: the centre is minus the translation
        found["points"] = np.loadtxt(out / "colmap_text/sparse/0/points3D.txt", usecols=(1, 2, 3))
        found["depth"] = -np.array(cameras_json(out)["cam_from_world"])[:3, 3]
    assert len(near) > 5 and near.keys() == far.keys()
    for name, place in near.items():
        sign = 1 if name in ("points", "depth") else -1
        assert np.abs(far[name] - place - sign * OFFSET).max() < 1e-5, name


def test_a_transforms_json_stays_near_and_leads_back(exports):
    near, far = (json.loads((out / "transforms/transforms.json").read_text()) for out in exports)
    assert far["applied_transform"] == np.column_stack([np.eye(3), -OFFSET]).tolist()
    assert near["applied_transform"] == np.eye(4)[:3].tolist()
    for one, other in zip(near["frames"], far["frames"], strict=True):
        assert np.abs(np.subtract(one["transform_matrix"], other["transform_matrix"])).max() < 1e-8


def test_cameras_of_the_world_draw_what_stands_there(runs, tmp_path):
    """A camera file is of the capture's world, as the capture is."""
    meta = {"w": 64, "h": 48, "fl_x": 50.0, "fl_y": 50.0, "cx": 32.0, "cy": 24.0}
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = OFFSET + np.array([0.2, 0, 0.5])
    (tmp_path / "path.json").write_text(json.dumps(meta | {"frames": [{"transform_matrix": pose.tolist()}]}))
    given = [f"path={tmp_path / 'path.json'}", f"to={tmp_path}", "save=depth_npy", "mesh.source=surfels"]
    assert cli.main(["render", f"run={runs[1]}", *given]) == 0
    (file,) = tmp_path.glob("*.npy")
    assert np.median(np.load(file)) == pytest.approx(WALL_Z - 0.5, abs=1e-3)
