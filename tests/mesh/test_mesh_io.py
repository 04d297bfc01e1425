"""Mesh files: whole or not at all, and refused by name."""

import json
import os
import struct
import sys

import numpy as np
import pytest
import trimesh
from PIL import Image

from room2dgs.errors import InputError
from room2dgs.mesh.io import read_mesh, write_mesh


def colored_box() -> trimesh.Trimesh:
    box = trimesh.creation.box((1, 2, 3))
    colors = np.arange(32, dtype=np.uint8).reshape(8, 4) * 8
    colors[:, 3] = 255
    return trimesh.Trimesh(box.vertices, box.faces, vertex_colors=colors, process=False)


def test_round_trip_keeps_order_and_colour(tmp_path):
    box = colored_box()
    write_mesh(tmp_path / "deep" / "box.ply", box)
    back = read_mesh(tmp_path / "deep" / "box.ply")
    assert np.allclose(back.vertices, box.vertices, atol=1e-7)
    assert np.array_equal(back.faces, box.faces)
    assert np.array_equal(back.visual.vertex_colors, box.visual.vertex_colors)


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / "mesh.ply"
    write_mesh(path, colored_box())
    before = path.read_bytes()

    def full_disk(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("room2dgs.files.os.fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_mesh(path, trimesh.creation.icosphere())
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["mesh.ply"]


def bad_files(folder):
    good = folder / "good.ply"
    write_mesh(good, colored_box())
    content = good.read_bytes()
    yield "missing.ply", None, "missing"
    yield "empty.ply", b"", "cannot be decoded|holds no triangles"
    yield "noise.ply", bytes(range(256)) * 4, "cannot be decoded"
    yield "short.ply", content[:-30], "cannot be decoded"
    yield "points.ply", trimesh.PointCloud(np.eye(3)).export(file_type="ply"), "holds no triangles"
    nan = colored_box()
    nan.vertices[3] = np.nan
    yield "nan.ply", trimesh.exchange.ply.export_ply(nan), "1 vertices that are NaN"
    text = "\n".join(["v 0 0 0", "v 1 0 0", "v 0 1 0", "f 1 2 9"])
    yield "index.obj", text.encode(), "cannot be decoded|not there"
    yield "kind.xyzzy", b"hello", "cannot be decoded"


def test_unusable_files_are_named(tmp_path):
    for name, content, sentence in bad_files(tmp_path):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputError, match=sentence) as caught:
            read_mesh(path)
        assert str(path) in str(caught.value), name
        assert "\n" not in str(caught.value), name


def test_a_mesh_file_opens_no_other(tmp_path):
    """A material, a texture or a buffer may be any file's path."""
    secret = tmp_path / "secret"
    secret.mkdir()
    png = secret / "texture.png"
    Image.new("RGB", (2, 2)).save(png)
    folder = tmp_path / "meshes"
    folder.mkdir()
    box = colored_box()
    (folder / "box.obj").write_text("mtllib ../secret/material.mtl\nusemtl any\n" + box.export(file_type="obj"))
    (secret / "material.mtl").write_text("newmtl any\nmap_Kd texture.png\n")
    named = b"comment TextureFile ../secret/texture.png\nelement vertex"
    (folder / "box.ply").write_bytes(box.export(file_type="ply").replace(b"element vertex", named, 1))
    opened, watching = [], [True]
    # a hook stays for the process: it is deaf afterwards
    sys.addaudithook(lambda event, args: opened.append(str(args[0])) if watching and event == "open" else None)
    for name in ("box.obj", "box.ply"):
        assert read_mesh(folder / name).area == pytest.approx(box.area, rel=1e-5)
    (folder / "box.glb").write_bytes(glb(box, uri="../secret/texture.png"))
    with pytest.raises(InputError, match=r"points to another file \(\.\./secret/texture\.png\)"):
        read_mesh(folder / "box.glb")
    watching.clear()
    assert any("box.obj" in path for path in opened) and not any("secret" in path for path in opened)


def glb(mesh: trimesh.Trimesh, uri: str | None = None, times: int = 1, count: int | None = None) -> bytes:
    """A GLB file, its description changed: its buffer elsewhere, placed several times, values of no buffer."""
    content = mesh.export(file_type="glb")
    length = struct.unpack("<I", content[12:16])[0]
    tree = json.loads(content[20 : 20 + length])
    if uri:
        tree["buffers"][0]["uri"] = uri
        rest = b""
    else:
        rest = content[20 + length :]
    if count:
        tree["accessors"].append({"count": count, "componentType": 5126, "type": "VEC3"})
    (node,) = (node for node in tree["nodes"] if "mesh" in node)
    tree["nodes"] += [dict(node)] * (times - 1)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + len(rest)
    return struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON") + text + rest


def test_a_glb_that_grows_when_it_is_read_is_refused(tmp_path):
    path = tmp_path / "box.glb"
    path.write_bytes(glb(colored_box()))
    assert np.array_equal(read_mesh(path).visual.vertex_colors, colored_box().visual.vertex_colors)
    for options, sentence in (({"count": 10**12}, "no buffer holds"), ({"times": 10_000_000 // 100}, "places")):
        path.write_bytes(glb(trimesh.creation.icosphere(5), **options))
        with pytest.raises(InputError, match=sentence):
            read_mesh(path)
    for content in (b"", b"glTF", glb(colored_box())[:30], b"[" * 100_000):
        path.write_bytes(content)
        with pytest.raises(InputError, match="cannot be decoded"):
            read_mesh(path)


def test_what_is_no_file_is_told(tmp_path):
    (tmp_path / "folder.ply").mkdir()
    os.mkfifo(tmp_path / "pipe.ply")
    (tmp_path / "gone.ply").symlink_to(tmp_path / "nothing.ply")
    for name, sentence in (("folder", "a folder"), ("pipe", "a pipe"), ("gone", "a link to")):
        with pytest.raises(InputError, match=sentence):
            read_mesh(tmp_path / f"{name}.ply")


@pytest.mark.parametrize("kind", ["obj", "off", "stl", "glb", "ply"])
def test_each_promised_kind_is_read_whatever_the_case_of_its_name(tmp_path, kind):
    path = tmp_path / f"box.{kind.upper()}"
    content = colored_box().export(file_type=kind)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert read_mesh(path).area == pytest.approx(22)
