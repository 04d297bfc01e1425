"""Where the depth prior contradicts the unit of the poses, the words name scene.unit with the number."""

from __future__ import annotations

import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.pipeline.units import unit_doubt
from room2dgs.runs.page.texts import logged_warnings

FIFTIETH = 0.02
WALL_Z = 2.0


def capture_of(wall, folder, factor):
    """The wall as nerfstudio has it, which does not tell its unit; its points and a prior's depth in metres."""
    (folder / "images").mkdir(parents=True)
    (folder / "maps").mkdir()
    frames = []
    for path in sorted((wall / "pose").iterdir()):
        pose = np.loadtxt(path) @ np.diag([1.0, -1.0, -1.0, 1.0])
        pose[:3, 3] *= factor
        photo = cv2.imread(str(wall / f"color/{path.stem}.png"))
        cv2.imwrite(str(folder / f"images/{path.stem}.png"), photo)
        np.save(folder / f"maps/{path.stem}.npy", np.full(photo.shape[:2], WALL_Z, np.float32))
        frames.append({"file_path": f"images/{path.stem}.png", "transform_matrix": pose.tolist()})
    meta = {"w": 64, "h": 48, "fl_x": 50.0, "fl_y": 50.0, "cx": 32.0, "cy": 24.0, "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(meta))
    cloud = trimesh.load(wall / "points.ply")
    trimesh.PointCloud(np.asarray(cloud.vertices) * factor, colors=cloud.colors).export(folder / "points.ply")
    return folder


def run(capture, out, *more: str) -> int:
    given = [f"scene.path={capture}", f"out={out}", "points.source=file", f"points.file={capture / 'points.ply'}"]
    given += ["sfm.refine_poses=false", "prior=files", f"prior.depth.path={capture / 'maps'}", "stereo.enabled=false"]
    given += ["prior.normal.source=none", "prior.depth.joint=false", "mesh.source=depth", "mesh.min_triangles=10"]
    return cli.main(["run", *given, "report.enabled=false", "eval.samples=500", *more])


@pytest.mark.parametrize(("factor", "unit"), [(FIFTIETH, "50"), (0.04, "25"), (0.001, "1000")])
def test_a_tiny_room_is_told_its_unit(wall, tmp_path, capsys, factor, unit):
    """Whether its points are far enough to count as seen (5 cm) or not."""
    capture = capture_of(wall, tmp_path / "tiny", factor)
    assert run(capture, tmp_path / "out", "mesh.min_triangles=50") == 2
    said = capsys.readouterr().err
    assert f"give scene.unit={unit}" in said and f"one unit of the poses is about {unit} m" in said
    assert "add photos" not in said and "larger voxels" not in said


def test_its_unit_mends_it(wall, tmp_path, capsys):
    """Points of a file are metres."""
    capture = capture_of(wall, tmp_path / "tiny", FIFTIETH)
    trimesh.load(wall / "points.ply").export(capture / "points.ply")
    out = tmp_path / "out"
    assert run(capture, out, "mesh.voxel_m=0.04", "scene.unit=50") == 0
    assert "scene.unit=5" not in capsys.readouterr().out.replace("scale: scene.unit=50 metres", "")
    assert json.loads((out / "metrics.json").read_text())["prior_scale"] == pytest.approx(1, abs=0.02)
    assert np.median(trimesh.load(out / "mesh.ply").vertices[:, 2]) == pytest.approx(WALL_Z, abs=0.01)


def test_a_surface_in_another_unit_is_warned_of(wall, tmp_path):
    capture = capture_of(wall, tmp_path / "small", 0.4)
    out = tmp_path / "out"
    assert run(capture, out, "mesh.voxel_m=0.04") == 0
    warned = logged_warnings((out / "log.txt").read_text().splitlines())
    assert any("scene.unit=2.5" in line for line in warned)


@pytest.mark.parametrize(
    ("scale", "metric", "unit", "words"),
    [
        (0.0203, False, None, "give scene.unit=49"),
        (0.45, False, None, "give scene.unit=2.2"),
        (0.6, False, None, None),
        (1.9, False, None, None),
        (2.1, False, None, "give scene.unit=0.48"),
        (0.45, True, None, None),
        (0.3, True, None, "if they are not, give scene.unit=3.3"),
        (1000.0, True, None, "give scene.unit=0.001"),
        (0.45, False, 2.0, None),
        (0.1, False, 0.001, "give scene.unit=0.01"),
        (10.0, True, 1.0, "give scene.unit=0.1"),
        (None, False, None, None),
    ],
)
def test_when_a_unit_is_doubted(scale, metric, unit, words):
    said = unit_doubt(scale, SimpleNamespace(metric=metric), unit)
    assert said is None if words is None else said.endswith(words)


def test_a_capture_that_tells_no_unit_may_have_another(wall, tmp_path, capsys):
    """Without a prior nobody knows, but that too is said."""
    capture = capture_of(wall, tmp_path / "tiny", FIFTIETH)
    assert run(capture, tmp_path / "out", "mesh.source=points", "prior=none", "mesh.min_triangles=100000") == 2
    said = capsys.readouterr().err
    assert "scene.unit" in said and "does not say its unit" in said
