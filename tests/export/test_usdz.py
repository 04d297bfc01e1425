"""USDZ: the package by the bytes of a zip, its scene by the text, both by OpenUSD where it is installed."""

from __future__ import annotations

import ast
import io
import re
import struct
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from room2dgs.export.axes import y_up_from
from room2dgs.export.texture.charts import Charts
from room2dgs.export.texture.usdz import packed_zip, usdz
from room2dgs.export.texture.write import Textured

TURN = y_up_from(np.array([0, 0, 1.0]))
FAR_M = np.array([500_000.125, 300.5, -5_400_000.25])


@pytest.fixture
def textured(painted) -> Textured:
    """The ball, each corner of each face a vertex of its own in the picture."""
    faces = np.asarray(painted.faces)
    source = faces.ravel()
    uv = np.random.default_rng(1).uniform(0, 1, (len(source), 2)).round(5)
    found = Charts(np.asarray(painted.vertices)[source], source, np.arange(len(source)).reshape(-1, 3), uv)
    picture = np.zeros((32, 32, 3), np.uint8)
    picture[:16] = 250, 20, 20
    return Textured(painted, found, picture)


def arrays(text: str) -> dict[str, np.ndarray]:
    found = re.findall(r"(\w+)\[\] ([\w:]+) = (\[[^\]]*\])", text)
    return {name: np.array(ast.literal_eval(values)) for kind, name, values in found if kind != "token"}


@given(st.dictionaries(st.text("abcd/._", min_size=1, max_size=70), st.binary(max_size=300), min_size=1, max_size=5))
def test_each_file_lies_uncompressed_at_a_multiple_of_64_bytes(files):
    data = packed_zip(files)
    with zipfile.ZipFile(io.BytesIO(data)) as package:
        assert package.testzip() is None and package.namelist() == list(files)
        for entry, content in zip(package.infolist(), files.values(), strict=True):
            name, extra = struct.unpack("<HH", data[entry.header_offset + 26 : entry.header_offset + 30])
            begin = entry.header_offset + 30 + name + extra
            assert begin % 64 == 0 and data[begin : begin + len(content)] == content
            assert entry.compress_type == zipfile.ZIP_STORED and package.read(entry) == content


def test_the_scene_is_in_metres_upright_and_has_its_picture(textured):
    with zipfile.ZipFile(io.BytesIO(usdz(textured, TURN, FAR_M))) as package:
        scene, picture = package.namelist()
        text, jpeg = package.read(scene).decode(), Image.open(io.BytesIO(package.read(picture)))
    assert scene.endswith(".usda") and text.startswith("#usda 1.0\n")
    assert "metersPerUnit = 1\n" in text and 'upAxis = "Y"\n' in text and f"@{picture}@" in text
    assert f"xformOp:translate = ({', '.join(f'{value:.17g}' for value in FAR_M)})" in text
    found, charts = arrays(text), textured.charts
    np.testing.assert_allclose(found["points"], charts.vertices @ TURN.T, atol=1e-6)
    np.testing.assert_array_equal(found["faceVertexIndices"].reshape(-1, 3), charts.faces)
    assert (found["faceVertexCounts"] == 3).all() and len(found["faceVertexCounts"]) == len(charts.faces)
    np.testing.assert_allclose(found["primvars:st"], charts.uv, atol=1e-6)  # v up, as in the charts
    np.testing.assert_allclose(found["extent"], [found["points"].min(axis=0), found["points"].max(axis=0)], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found["normals"], axis=1), 1, atol=1e-3)
    outward = found["points"] - (1, 3, -2)
    assert (np.einsum("ni,ni->n", found["normals"], outward) > 0.45).all()
    shown = np.asarray(jpeg.convert("RGB")).astype(int)
    assert np.abs(shown[:14] - (250, 20, 20)).max() < 12 and shown[18:].max() < 12


def test_equal_rooms_give_equal_bytes_and_no_translation_where_none_is_needed(textured):
    assert usdz(textured, TURN) == usdz(textured, TURN)
    assert b"translate" not in usdz(textured, TURN)


def test_openusd_opens_it_and_finds_nothing_wrong(textured, tmp_path):
    usd = pytest.importorskip("pxr.Usd", reason="no OpenUSD here (pip install usd-core)")
    from pxr import UsdGeom, UsdShade, UsdValidation

    (tmp_path / "room.usdz").write_bytes(usdz(textured, TURN, FAR_M))
    stage = usd.Stage.Open(str(tmp_path / "room.usdz"))
    rules = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [one.GetMessage() for one in rules.Validate(stage)] == []
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0 and UsdGeom.GetStageUpAxis(stage) == "Y"
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/room/mesh"))
    places = np.array(mesh.GetPointsAttr().Get())
    np.testing.assert_allclose(places, textured.charts.vertices @ TURN.T, atol=1e-6)
    moved = np.array(mesh.ComputeLocalToWorldTransform(0.0).Transform((0, 0, 0)))
    assert moved.tolist() == FAR_M.tolist()
    assert UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0].GetPath() == "/room/material"
