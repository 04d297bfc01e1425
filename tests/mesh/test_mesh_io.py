"""Mesh files: whole or not at all, and refused by name."""

import numpy as np
import pytest
import trimesh

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
