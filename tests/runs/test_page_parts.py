"""Parts of report.html on their own: the room's size, the textured mesh inside, files, commands, folders taken out."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from PIL import Image

from room2dgs.config import load_config
from room2dgs.export.texture.charts import charts
from room2dgs.export.texture.write import glb_of
from room2dgs.runs.page.cameras import camera_size_m
from room2dgs.runs.page.places import Places, named_only
from room2dgs.runs.page.results import files_of, next_steps
from room2dgs.runs.page.room import RoomFacts, belongs, first_facts, glb_box, read_glb
from room2dgs.runs.verdict import Verdict

TURN = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up


@pytest.fixture(scope="module")
def textured():
    mesh = trimesh.creation.box((4.0, 3.0, 2.5))
    picture = np.zeros((256, 256, 3), np.uint8)
    return mesh, glb_of(mesh, charts(mesh, 256), picture, TURN)


def test_the_glb_of_a_run_is_known_by_its_box(textured, tmp_path):
    mesh, data = textured
    assert np.allclose(glb_box(data), [[-2, -1.25, -1.5], [2, 1.25, 1.5]])
    assert belongs(data, TURN.T, np.asarray(mesh.vertices))
    assert not belongs(data, TURN.T, np.asarray(mesh.vertices) * 1.2)  # of another mesh
    assert not belongs(data, np.eye(3), np.asarray(mesh.vertices))  # turned otherwise
    (tmp_path / "mesh.glb").write_bytes(data)
    assert read_glb(tmp_path / "mesh.glb") == data
    assert read_glb(tmp_path / "none.glb") is None


@pytest.mark.parametrize("keep", [0, 11, 19, 60, 300])
def test_a_torn_glb_is_none(textured, keep, tmp_path):
    (tmp_path / "mesh.glb").write_bytes(textured[1][:keep])
    assert read_glb(tmp_path / "mesh.glb") is None


def test_a_glb_without_a_picture_is_none(tmp_path):
    (tmp_path / "mesh.glb").write_bytes(trimesh.creation.box().export(file_type="glb"))
    assert read_glb(tmp_path / "mesh.glb") is None


def test_first_comes_how_large_the_room_is_and_how_complete():
    room = RoomFacts(size_m=(4.5, 3.5), area_m2=15.75, height_m=2.6)
    metrics = {"mesh_quality": {"coverage": 0.953}, "verdict": {"measures": {"coverage": 0.99}}}
    found = [one["value"] for one in first_facts(room, metrics, "m", None)]
    assert found == ["4.50 × 3.50 m", "15.8 m²", "2.60 m", "95%"]
    (box,) = first_facts(RoomFacts(), {"verdict": None}, "units", np.array([5.0, 4.0, 2.5]))
    assert box["value"] == "5.0 × 4.0 × 2.5 units"
    assert first_facts(RoomFacts(), {"mesh_quality": {"coverage": "much"}}, "m", None) == []


def test_files_that_are_there_are_offered(tmp_path):
    (tmp_path / "mesh.glb").write_bytes(bytes(1_500_000))
    (tmp_path / "metrics.json").write_text("{}")
    (tmp_path / "plan").mkdir()
    (tmp_path / "plan" / "plan.svg").write_text("<svg/>")
    found = {one.path: one for one in files_of(tmp_path, glb_inside=True)}
    assert list(found) == ["mesh.glb", "plan/plan.svg", "metrics.json"]
    assert (found["mesh.glb"].size, found["mesh.glb"].inside, found["plan/plan.svg"].inside) == ("1.5 MB", "glb", "")
    assert files_of(tmp_path, glb_inside=False)[0].inside == ""


def test_commands_name_the_run_as_a_shell_takes_it():
    commands = [step.command for step in next_steps("my room", textured=False, trained=True)]
    assert "room2dgs view 'my room'" in commands and "room2dgs export 'my room' to=textured" in commands
    assert not [one for one in (s.command for s in next_steps("r", True, trained=False)) if "render" in one]


def test_folders_are_taken_out_of_texts():
    config = load_config(["scene.path=/data/ann/rooms/kitchen", "out=/data/ann/runs/kitchen_1", "eval.gt=/scans/k.ply"])
    places = Places(config)
    text = "Capture /data/ann/rooms/kitchen, truth /scans/k.ply; mesh out=/data/ann/runs/kitchen_1, /data/ann/runs/b"
    assert places.out_of(text) == "Capture kitchen, truth k.ply; mesh out=kitchen_1, b"
    verdict = Verdict("usable", ("poor /scans/k.ply",), ("see /data/ann/rooms/kitchen/a.jpg",), {}, ())
    cleaned = places.out_of_verdict(verdict)
    assert cleaned is not None and (cleaned.reasons, cleaned.advice) == (("poor k.ply",), ("see kitchen/a.jpg",))
    assert places.out_of_verdict(None) is None
    assert (named_only(config).scene.path, named_only(config).out) == ("kitchen", "kitchen_1")
    assert config.scene.path == "/data/ann/rooms/kitchen"  # the run's own stay


def test_cameras_are_drawn_as_their_spacing_allows(make):
    def row(step):
        return [make.camera_at((step * i, 0, 1), (0, 1, 0)) for i in range(8)]

    assert camera_size_m(row(0.1)) == pytest.approx(0.06)
    assert camera_size_m(row(5.0)) == 0.2 and camera_size_m(row(0.0)) == 0.02


def test_the_picture_in_the_glb_is_a_jpeg(textured):
    scene = trimesh.load(io.BytesIO(textured[1]), file_type="glb")
    (mesh,) = scene.geometry.values()
    assert isinstance(mesh.visual.material.baseColorTexture, Image.Image)
