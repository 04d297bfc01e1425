"""Meshes far from the origin keep their millimetres on the disk; near it nothing changes."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.captures.world_offset import AT_ORIGIN, in_scene, in_world, origin_beside, too_far_for_float32
from room2dgs.mesh.io import read_mesh, write_mesh
from room2dgs.mesh.world import mesh_in_scene, mesh_in_world, read_in_scene, write_in_world

UTM = (500000.13, 5400000.37, 300.21)
SIZE = (3.3, 2.7, 2.4)


@pytest.fixture
def box() -> trimesh.Trimesh:
    mesh = trimesh.creation.box(SIZE)
    mesh.visual.vertex_colors = np.random.default_rng(0).integers(0, 255, (8, 4), np.uint8)
    return mesh


@pytest.mark.parametrize("normals", [False, True])
def test_a_box_at_utm_coordinates_comes_back_as_it_was(tmp_path, box, normals):
    box.apply_translation(UTM)
    if normals:
        assert len(box.vertex_normals)  # at hand: written too
    write_mesh(tmp_path / "box.ply", box)
    again = read_mesh(tmp_path / "box.ply")
    assert np.abs(np.ptp(again.vertices, axis=0) - SIZE).max() < 1e-6
    assert np.abs(again.vertices - box.vertices).max() < 1e-9
    assert np.array_equal(again.faces, box.faces)
    assert np.array_equal(again.visual.vertex_colors, box.visual.vertex_colors)


def test_other_programs_read_doubles(tmp_path, box):
    write_in_world(tmp_path / "box.ply", box, UTM)
    seen = o3d.io.read_triangle_mesh(str(tmp_path / "box.ply"))
    assert np.abs(np.ptp(np.asarray(seen.vertices), axis=0) - SIZE).max() < 1e-6
    assert np.abs(np.asarray(seen.vertex_colors) * 255 - box.visual.vertex_colors[:, :3]).max() < 0.5


def test_near_the_origin_the_bytes_are_as_before(tmp_path, box):
    box.apply_translation((1000.0, 20.0, -1000.0))
    write_mesh(tmp_path / "box.ply", box)
    assert (tmp_path / "box.ply").read_bytes() == box.export(file_type="ply")
    assert mesh_in_world(box, AT_ORIGIN) is box
    assert mesh_in_scene(box, AT_ORIGIN) is box


def test_a_mesh_goes_to_the_world_and_back(tmp_path, box):
    origin = origin_beside(np.array(UTM))
    write_in_world(tmp_path / "box.ply", box, origin)
    assert np.abs(read_mesh(tmp_path / "box.ply").vertices - box.vertices - origin).max() < 1e-9
    again = read_in_scene(tmp_path / "box.ply", origin)
    assert np.abs(again.vertices - box.vertices).max() < 1e-9
    assert np.allclose(again.vertex_normals, box.vertex_normals)


coordinates = st.floats(-1e7, 1e7, allow_nan=False)


@given(st.tuples(coordinates, coordinates, coordinates))
@settings(deadline=None)
def test_an_origin_is_beside_the_camera_or_where_it_was(centre):
    pose = np.eye(4)
    pose[:3, 3] = centre
    origin = origin_beside(pose[:3, 3])
    if np.abs(pose[:3, 3]).max() < 1024:
        assert origin == AT_ORIGIN
        assert np.array_equal(in_scene(pose, origin), pose)
    else:
        local = in_scene(pose, origin)
        assert np.abs(local[:3, 3]).max() <= 50
        assert not too_far_for_float32(local[:3, 3])
        assert np.abs(in_world(local, origin) - pose).max() < 1e-8  # a step of double there is 2e-9
