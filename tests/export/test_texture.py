"""Textures baked from photos of a patterned wall whose colours are known everywhere."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image

from room2dgs import _C
from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.export.axes import y_up_from
from room2dgs.export.texture.bake import baked, spread
from room2dgs.export.texture.charts import charts, texels
from room2dgs.export.texture.write import Textured, glb_of, picture_side, write_textured_obj

WALL_Z, SIDE = 2.0, 256
PLATE = (0.3, 0.7, -0.3, 0.3, 1.2)  # x, y, z: between cameras and wall, magenta
GAINS = np.array([0.8, 1.1, 0.9, 1.2, 1.0, 0.85, 1.15, 1.0])


def colors_at(points: np.ndarray) -> np.ndarray:
    """As conftest paints the wall."""
    light = 127 + 90 * np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1])
    return np.stack([np.full_like(light, 90), 255 - light, light], axis=1)


@pytest.fixture(scope="module")
def frames(wall, tmp_path_factory):
    """The wall's photos with a plate before it, each of another exposure."""
    folder = tmp_path_factory.mktemp("photos")
    scene = read_scene(load_config([f"scene.path={wall}", "out=unused"]).scene)
    x0, x1, y0, y1, z = PLATE
    changed = []
    for number, frame in enumerate(scene.frames):
        hit = frame.camera.centre + frame.camera.world_rays() * z
        plate = (hit[..., 0] > x0) & (hit[..., 0] < x1) & (hit[..., 1] > y0) & (hit[..., 1] < y1)
        photo = np.where(plate[..., None], (255, 0, 255), frame.color()) * GAINS[number]
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), photo.clip(0, 255).astype(np.uint8)[..., ::-1])
        changed.append(replace(frame, color_path=path, photo=None, cache=None))
    return changed


def plate_mesh() -> trimesh.Trimesh:
    x0, x1, y0, y1, z = PLATE
    return trimesh.Trimesh([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)], [(0, 2, 1), (0, 3, 2)], process=False)


@pytest.fixture(scope="module")
def picture(wall, frames):
    wall_mesh = trimesh.load(wall / "gt_mesh.ply", process=False)
    # towards the cameras
    wall_mesh = trimesh.Trimesh(
        wall_mesh.vertices,
        wall_mesh.faces if wall_mesh.face_normals[0, 2] < 0 else wall_mesh.faces[:, ::-1],
        vertex_colors=np.full((len(wall_mesh.vertices), 3), 50, np.uint8),
        process=False,
    )
    found = charts(wall_mesh, SIDE)
    shown = texels(found, SIDE)
    whole = trimesh.util.concatenate([wall_mesh, plate_mesh()])
    return wall_mesh, found, shown, *baked(wall_mesh, whole, found, shown, frames, SIDE)


def test_charts_are_the_mesh_laid_flat_without_overlap(picture):
    mesh, found, shown, _, _ = picture
    np.testing.assert_array_equal(found.source[found.faces], mesh.faces)
    assert found.uv.min() >= 0 and found.uv.max() <= 1
    a, b, c = (found.uv[found.faces[:, k]] for k in range(3))
    first, second = b - a, c - a
    flat = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    texels_of = np.bincount(shown.face, minlength=len(mesh.faces))
    # no face is hidden by another in the picture
    assert np.abs(texels_of - flat * SIDE**2).max() < 6 + 0.2 * flat.max() * SIDE**2
    place = shown.of_vertices(found.faces, found.vertices)
    again = (shown.texel[:, ::-1] + 0.5) / SIDE * (1, -1) + (0, 1)
    np.testing.assert_allclose(shown.of_vertices(found.faces, found.uv), again, atol=1e-4)
    assert np.abs(place[:, 2] - WALL_Z).max() < 1e-6


def test_the_picture_is_the_wall_without_the_plate_and_of_one_exposure(picture, frames):
    _, found, shown, baked_picture, share = picture
    points = shown.of_vertices(found.faces, found.vertices)
    rows, columns = shown.texel.T
    got = baked_picture[rows, columns].astype(float)
    well = np.zeros(len(points), int)
    x0, x1, y0, y1, z = PLATE
    for frame in frames:
        centre = frame.camera.centre
        x, y = (centre + (points - centre) * z / WALL_Z)[:, :2].T  # where the ray passes the plate
        hidden = (x > x0 - 0.05) & (x < x1 + 0.05) & (y > y0 - 0.05) & (y < y1 + 0.05)
        well += frame.camera.in_view(points) & ~hidden
    many = well >= 2
    truth = colors_at(points[many])
    ratio = np.median(got[many] / truth)
    off = np.abs(got[many] / ratio - truth)
    assert np.median(off) < 4  # of 255: the photos' own pixels and rounding
    assert (off > 30).mean() < 0.02  # neither magenta from the plate nor steps between photos
    assert 0.8 < share <= 1


@pytest.mark.parametrize(
    ("side", "count", "most", "px"), [(64, 8, 2048, 512), (640, 53, 2048, 2048), (1, 1, 2048, 256)]
)
def test_the_picture_is_no_larger_than_its_photos_can_fill(side, count, most, px):
    frame = SimpleNamespace(camera=SimpleNamespace(width=side, height=side))
    assert picture_side([frame] * count, most) == px
    assert px == most or 2 * px * px >= side * side * count  # room for each pixel, with half of it used


def test_what_no_photo_sees_has_the_meshs_colours(picture, frames):
    _, found, shown, baked_picture, _ = picture
    points = shown.of_vertices(found.faces, found.vertices)
    unseen = ~np.any([frame.camera.in_view(points) for frame in frames], axis=0)
    rows, columns = shown.texel[unseen].T
    assert unseen.any() and (baked_picture[rows, columns] == 50).all()


def test_the_glb_shows_the_picture_where_the_surface_is(picture):
    mesh, found, _, baked_picture, _ = picture
    glb = glb_of(mesh, found, baked_picture, np.eye(3))
    again = trimesh.load(io.BytesIO(glb), file_type="glb", force="mesh", process=False)
    np.testing.assert_allclose(again.vertices, found.vertices, atol=1e-5)
    np.testing.assert_allclose(again.visual.uv, found.uv, atol=1e-5)
    stored = np.asarray(again.visual.material.baseColorTexture.convert("RGB")).astype(int)
    assert np.abs(stored - baked_picture).mean() < 4  # JPEG
    assert isinstance(again.visual.material.baseColorTexture, Image.Image)
    jpeg = Image.open(io.BytesIO(glb[glb.index(b"\xff\xd8\xff") :]))
    assert max(jpeg.quantization[0]) < 30  # of quality 90; trimesh's own 75 has 60 and more


def test_the_glb_has_the_expected_error_of_its_vertices(picture):
    mesh, found, _, baked_picture, _ = picture
    sure = mesh.copy()
    sure.vertex_attributes["expected_error"] = np.arange(len(mesh.vertices), dtype=np.float32)
    again = trimesh.load(io.BytesIO(glb_of(sure, found, baked_picture, np.eye(3))), file_type="glb", process=False)
    (part,) = again.geometry.values()
    np.testing.assert_array_equal(np.ravel(part.vertex_attributes["_EXPECTED_ERROR"]), found.source)


def test_the_glb_says_what_it_is_and_is_shown_as_bright_as_its_photos(picture):
    """glTF's tree, as any reader has it: no lamp shades what has its light in it."""
    mesh, found, _, baked_picture, _ = picture
    glb = glb_of(mesh, found, baked_picture, np.eye(3))
    length = int.from_bytes(glb[12:16], "little")
    tree = json.loads(glb[20 : 20 + length])
    assert tree["extensionsUsed"] == ["KHR_materials_unlit"]
    assert [one["extensions"] for one in tree["materials"]] == [{"KHR_materials_unlit": {}}]
    assert tree["asset"]["generator"].startswith("room2dgs ") and tree["asset"]["extras"] == {"unit": "metre"}
    assert {node["name"] for node in tree["nodes"] if "mesh" in node} == {"room"} == {m["name"] for m in tree["meshes"]}


def test_the_picture_has_the_same_bits_on_one_and_two_threads(picture, frames):
    mesh, found, shown, baked_picture, _ = picture
    before = _C.threads()
    try:
        for count in (1, 2):
            _C.set_threads(count)
            assert np.array_equal(texels(found, SIDE).weights, shown.weights)
            whole = trimesh.util.concatenate([mesh, plate_mesh()])
            assert np.array_equal(baked(mesh, whole, found, shown, frames, SIDE)[0], baked_picture)
    finally:
        _C.set_threads(before)


def test_spreading_takes_the_nearest():
    covered = np.zeros((5, 5), bool)
    covered[2, 1] = covered[2, 4] = True
    picture = np.zeros((5, 5, 3), np.uint8)
    picture[2, 1], picture[2, 4] = 10, 200
    assert spread(picture, covered)[2, :, 0].tolist() == [10, 10, 10, 200, 200]


def test_the_obj_names_its_picture_and_is_not_torn_by_charts(picture, tmp_path):
    mesh, found, _, baked_picture, _ = picture
    turn = y_up_from(np.array([0, -1.0, 0]))
    offset_m = np.array([0.0, 2.0, -1.0])
    source = SimpleNamespace(
        textured=Textured(mesh, found, baked_picture), y_up=turn, offset_m=lambda rotation: offset_m
    )
    assert sorted(path.name for path in write_textured_obj(source, tmp_path)) == ["room.mtl", "room.obj", "room.png"]
    again = trimesh.load(tmp_path / "room.obj", process=False)
    assert np.array_equal(np.asarray(again.visual.material.image.convert("RGB")), baked_picture)
    pairs = np.concatenate([again.vertices, again.visual.uv], axis=1)[again.faces.ravel()]
    expected = np.concatenate([found.vertices @ turn.T + offset_m, found.uv], axis=1)[found.faces.ravel()]
    np.testing.assert_allclose(pairs, expected, atol=2e-6)
    lines = (tmp_path / "room.obj").read_text().splitlines()
    assert sum(line.startswith("v ") for line in lines) == len(mesh.vertices)  # a place once, whatever its charts
