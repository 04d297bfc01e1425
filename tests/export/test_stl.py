"""STL by the bytes of the format, and as Open3D and trimesh open it."""

from __future__ import annotations

import io

import numpy as np
import open3d
import pytest
import trimesh

from room2dgs.export.axes import z_up_from
from room2dgs.export.stl import HEADER, stl

AXES = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]


@pytest.mark.parametrize("up", AXES)
def test_up_is_along_z_and_nothing_is_mirrored(up):
    turn = z_up_from(np.array(up, float))
    assert (turn @ up).tolist() == [0, 0, 1] and np.linalg.det(turn) == pytest.approx(1)


def test_a_world_with_z_up_stays_as_it_is():
    assert z_up_from(np.array([0, 0, 1.0])).tolist() == np.eye(3).tolist() == z_up_from(None).tolist()


def test_a_file_is_a_head_that_says_metres_and_fifty_bytes_a_triangle(painted):
    data = stl(painted, np.eye(3))
    assert b"metre" in data[:HEADER] and b"z up" in data[:HEADER]
    assert not data.startswith(b"solid")  # readers would take it for text
    assert int.from_bytes(data[HEADER : HEADER + 4], "little") == len(painted.faces)
    rows = np.frombuffer(data[HEADER + 4 :], np.dtype([("v", "<f4", (4, 3)), ("bytes", "<u2")]))
    corners = np.asarray(painted.vertices)[painted.faces]
    np.testing.assert_allclose(rows["v"][:, 1:], corners, atol=1e-6)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    np.testing.assert_allclose(rows["v"][:, 0], facing, atol=1e-4)


def test_trimesh_and_open3d_open_it_upright(painted, tmp_path):
    turn = z_up_from(np.array([0, -1.0, 0]))  # its world has y down: z of the file is -y
    (tmp_path / "mesh.stl").write_bytes(stl(painted, turn))
    low, high = painted.bounds
    one = trimesh.load(io.BytesIO((tmp_path / "mesh.stl").read_bytes()), file_type="stl")
    other = open3d.io.read_triangle_mesh(str(tmp_path / "mesh.stl"))
    for bounds in (one.bounds, np.array([other.get_min_bound(), other.get_max_bound()])):
        np.testing.assert_allclose(bounds[:, 2], (-high[1], -low[1]), atol=1e-6)
        np.testing.assert_allclose(bounds[:, 0], (low[0], high[0]), atol=1e-6)
    assert one.is_watertight and one.volume == pytest.approx(painted.volume, rel=1e-5)  # its inside is inside
    assert len(other.triangles) == len(painted.faces)
