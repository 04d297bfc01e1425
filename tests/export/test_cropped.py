"""A mesh cut to a box as PLY and as GLB: what is inside stays as it was, and nothing else is there."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from PIL import Image

from room2dgs.errors import InputError
from room2dgs.export.axes import y_up_from
from room2dgs.export.cropped import cropped_glb, cropped_ply
from room2dgs.export.texture.charts import Charts
from room2dgs.export.texture.write import glb_of
from room2dgs.mesh.io import write_mesh

BOX = np.array([0.0, 1.0, 3.0]), np.array([2.0, 3.0, 4.0])  # the upper half of the ball at (1, 2, 3)
ORIGIN_M = (400_000.0, 5_000_000.0, 100.0)
TURN = y_up_from(np.array([0, 0, 1.0]))


def upper(mesh: trimesh.Trimesh) -> np.ndarray:
    """Corners of its faces in the box, sorted."""
    places = np.asarray(mesh.vertices)[mesh.faces]
    return sorted_corners(places[(places[..., 2] >= 3.0).all(axis=1)])


def sorted_corners(places: np.ndarray) -> np.ndarray:
    rows = places.reshape(len(places), -1).round(4)
    return rows[np.lexsort(rows.T)]


def test_a_ply_keeps_colours_and_its_world(painted, tmp_path):
    far = painted.copy()
    far.apply_translation(ORIGIN_M)
    write_mesh(tmp_path / "mesh.ply", far)
    data = cropped_ply(tmp_path / "mesh.ply", BOX, ORIGIN_M)
    found = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
    places = np.asarray(found.vertices) - ORIGIN_M
    np.testing.assert_allclose(sorted_corners(places[found.faces]), upper(painted), atol=2e-4)
    assert 0 < len(found.faces) < len(painted.faces) and len(found.vertices) == len(np.unique(found.faces))
    red = np.round((places[:, 2] - 2.5) * 255)
    np.testing.assert_allclose(found.visual.vertex_colors[:, 0], red, atol=1)


@pytest.fixture
def textured(painted, tmp_path):
    source = np.asarray(painted.faces).ravel()
    uv = np.random.default_rng(1).uniform(0, 1, (len(source), 2))
    charts = Charts(np.asarray(painted.vertices)[source], source, np.arange(len(source)).reshape(-1, 3), uv)
    picture = np.random.default_rng(2).integers(0, 255, (64, 64, 3), np.uint8)
    (tmp_path / "mesh.glb").write_bytes(glb_of(painted, charts, picture, TURN, TURN @ ORIGIN_M))
    return tmp_path / "mesh.glb", charts


def test_a_glb_keeps_its_picture_its_places_in_it_and_its_place_in_the_world(painted, textured):
    path, charts = textured
    data = cropped_glb(path, BOX, TURN, TURN @ ORIGIN_M)
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False)
    (found,) = scene.geometry.values()
    np.testing.assert_allclose(sorted_corners((found.vertices @ TURN)[found.faces]), upper(painted), atol=2e-4)
    matrix = scene.graph[scene.graph.nodes_geometry[0]][0]
    np.testing.assert_allclose(matrix[:3, 3], TURN @ ORIGIN_M)
    expected = {tuple(row) for row in np.column_stack([charts.vertices, charts.uv]).round(4)}
    got = {tuple(row) for row in np.column_stack([found.vertices @ TURN, found.visual.uv]).round(4)}
    assert len(got - expected) < 0.05 * len(got)  # rounding at the last digit
    after, before = picture_of(data), picture_of(path.read_bytes())
    assert after.quantization == before.quantization  # it is not encoded coarser
    assert np.abs(np.asarray(after, float) - np.asarray(before, float)).mean() < 1


def picture_of(glb: bytes) -> Image.Image:
    return Image.open(io.BytesIO(glb[glb.index(b"\xff\xd8\xff") :]))


def test_a_glb_without_a_picture_is_said_in_a_sentence(tmp_path):
    (tmp_path / "mesh.glb").write_bytes(b"glTF")
    with pytest.raises(InputError, match="room2dgs mesh"):
        cropped_glb(tmp_path / "mesh.glb", BOX, TURN, np.zeros(3))
