"""Meshes for other programs, read by trimesh and by the bytes of the formats."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pytest
import trimesh

from room2dgs.export.axes import y_up_from
from room2dgs.export.mesh_files import glb, linear, obj, ply
from room2dgs.lengths.scaled_files import scaled_glb

Z_UP = np.array([0, 0, 1.0])


def parts_of_glb(data: bytes) -> tuple[dict, dict[str, np.ndarray]]:
    """The JSON, and the arrays of the only primitive by attribute, by the layout in the glTF specification."""
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON"
    tree = json.loads(data[20 : 20 + size])
    body = data[20 + size + 8 :]
    (primitive,) = tree["meshes"][0]["primitives"]
    arrays = {}
    for name, index in {**primitive["attributes"], "indices": primitive["indices"]}.items():
        accessor = tree["accessors"][index]
        view = tree["bufferViews"][accessor["bufferView"]]
        kind = {5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        arrays[name] = np.frombuffer(body, kind, accessor["count"] * width, start).reshape(-1, width)
    return tree, arrays


def test_glb_stands_upright_with_linear_colours_and_a_dull_material(painted):
    tree, found = parts_of_glb(glb(painted, y_up_from(Z_UP)))
    x, y, z = np.asarray(painted.vertices).T
    np.testing.assert_allclose(found["POSITION"], np.stack([x, z, -y], axis=1), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(found["NORMAL"], axis=1), 1, atol=1e-5)
    outward = found["POSITION"] - (1, 3, -2)
    assert (np.einsum("ni,ni->n", found["NORMAL"], outward) > 0.45).all()
    color = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    assert color["normalized"] and color["type"] == "VEC4"
    srgb = painted.visual.vertex_colors[:, :3] / 255
    by_definition = np.where(srgb > 0.04045, ((srgb + 0.055) / 1.055) ** 2.4, srgb / 12.92)
    np.testing.assert_allclose(found["COLOR_0"][:, :3] / 65535, by_definition, atol=1 / 65535)
    material = tree["materials"][0]["pbrMetallicRoughness"]
    assert (material["metallicFactor"], material["roughnessFactor"]) == (0, 1)
    corners = found["POSITION"][found["indices"].reshape(-1, 3)]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ni,ni->n", facing, corners.mean(axis=1) - (1, 3, -2)) > 0).all()  # still counter-clockwise


def test_the_glb_says_how_far_off_each_vertex_is_expected_to_be(painted):
    expected = np.linspace(0.001, 0.1, len(painted.vertices), dtype=np.float32)
    sure = painted.copy()
    sure.vertex_attributes["expected_error"] = expected
    data = glb(sure, y_up_from(Z_UP))
    np.testing.assert_array_equal(parts_of_glb(data)[1]["_EXPECTED_ERROR"][:, 0], expected)
    _, halved = parts_of_glb(scaled_glb(data, 0.5, "mesh.glb"))
    np.testing.assert_allclose(halved["_EXPECTED_ERROR"][:, 0], expected / 2, rtol=1e-6)
    assert "_EXPECTED_ERROR" not in parts_of_glb(glb(painted, y_up_from(Z_UP)))[1]


def test_glb_keeps_the_rules_of_buffers(painted):
    """What a validator looks at: padding, alignment, extremes of places, extensions that are used."""
    data = glb(painted, y_up_from(Z_UP))
    tree, found = parts_of_glb(data)
    size = int.from_bytes(data[12:16], "little")
    assert size % 4 == 0 and int.from_bytes(data[20 + size : 24 + size], "little") % 4 == 0
    assert tree["buffers"][0]["byteLength"] <= len(data) - 28 - size
    for accessor in tree["accessors"]:
        view = tree["bufferViews"][accessor["bufferView"]]
        width = {5123: 2, 5125: 4, 5126: 4}[accessor["componentType"]]
        assert (view.get("byteOffset", 0) + accessor.get("byteOffset", 0)) % width == 0
    place = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    np.testing.assert_array_equal(np.float32(place["min"]), found["POSITION"].min(axis=0))
    np.testing.assert_array_equal(np.float32(place["max"]), found["POSITION"].max(axis=0))
    used = {name for one in tree["materials"] for name in one.get("extensions", {})}
    assert used == set(tree["extensionsUsed"]) == {"KHR_materials_unlit"}


def test_trimesh_opens_the_glb(painted):
    again = trimesh.load(io.BytesIO(glb(painted, np.eye(3))), file_type="glb", force="mesh", process=False)
    np.testing.assert_allclose(again.vertices, painted.vertices, atol=1e-5)
    np.testing.assert_array_equal(again.faces, painted.faces)


def test_a_face_without_area_does_not_spoil_a_normal():
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    _, found = parts_of_glb(glb(mesh, np.eye(3)))
    np.testing.assert_allclose(np.linalg.norm(found["NORMAL"], axis=1), 1, atol=1e-6)


def test_linear_ends():
    assert linear(np.array([[0, 255, 128]], np.uint8)).tolist() == [[0, 65535, pytest.approx(14147, abs=2), 65535]]


def test_obj_lines(painted):
    lines = obj(painted, y_up_from(Z_UP)).decode().splitlines()
    rows = [line.split() for line in lines]
    places = np.array([row[1:] for row in rows if row[0] == "v"], float)
    x, y, z = np.asarray(painted.vertices).T
    np.testing.assert_allclose(places[:, :3], np.stack([x, z, -y], axis=1), atol=1e-6)
    np.testing.assert_allclose(places[:, 3:], painted.visual.vertex_colors[:, :3] / 255, atol=1e-4)
    faces = np.array([[int(part.split("//")[0]) for part in row[1:]] for row in rows if row[0] == "f"])
    np.testing.assert_array_equal(faces - 1, painted.faces)
    assert sum(row[0] == "vn" for row in rows) == len(painted.vertices)


def test_ply_keeps_the_world_and_its_colours(painted):
    data = ply(painted)
    again = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
    np.testing.assert_allclose(again.vertices, painted.vertices, atol=1e-6)
    np.testing.assert_array_equal(again.visual.vertex_colors, painted.visual.vertex_colors)
    assert b"property float nx" in data[:600]
    np.testing.assert_allclose(again.vertex_normals, painted.vertex_normals, atol=1e-4)
