"""Meshes with fewer faces stay where they are, and say how far they do not."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from room2dgs.mesh import simplify
from room2dgs.mesh.fill import holes_filled, watertight
from room2dgs.mesh.simplify import decimated, measured, simplified


@pytest.fixture(scope="module")
def wavy() -> trimesh.Trimesh:
    """A sheet of 1 m with waves of 1 cm on one half, flat on the other; red grows with x."""
    x, y = np.meshgrid(np.linspace(0, 1, 81), np.linspace(0, 1, 81), indexing="ij")
    z = np.where(x < 0.5, 0.01 * np.sin(40 * x) * np.sin(30 * y), 0.0)
    index = np.arange(81 * 81).reshape(81, 81)
    p, q, r, s = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    colors = np.stack([np.round(x * 255), np.full_like(x, 9), np.full_like(x, 99)], axis=-1).reshape(-1, 3)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3) + 50.0  # far from the origin, where float32 is coarse
    return trimesh.Trimesh(vertices, faces, vertex_colors=colors.astype(np.uint8), process=False)


def test_the_error_is_within_the_bound_and_the_faces_are_few(wavy):
    found = simplified(wavy, max_error_m=0.002)
    assert found.mean_m < found.most_m <= 0.002
    assert found.largest_m < 0.005
    assert len(found.mesh.faces) < 0.2 * len(wavy.faces)
    dense, _ = trimesh.sample.sample_surface(found.mesh, 200_000, seed=0)  # 2 mm apart
    assert KDTree(dense).query(wavy.vertices[::7])[0].max() < np.hypot(found.largest_m, 0.006)


def test_a_wider_bound_gives_fewer_faces_and_a_number_of_faces_is_met(wavy):
    wide, narrow = simplified(wavy, max_error_m=0.005), simplified(wavy, max_error_m=0.001)
    assert len(wide.mesh.faces) < 0.7 * len(narrow.mesh.faces)
    assert len(simplified(wavy, faces=2000).mesh.faces) == pytest.approx(2000, abs=2)
    assert len(simplified(wavy, faces=2000, max_error_m=0.5).mesh.faces) == pytest.approx(2000, abs=2)
    assert simplified(wavy, faces=10**6).mesh is wavy


def test_colours_stay_where_they_were(wavy):
    less = decimated(wavy, 1500)
    red = np.asarray(less.visual.vertex_colors)[:, 0] / 255
    assert np.abs(red - (less.vertices[:, 0] - 50)).max() < 0.03


def test_a_large_mesh_is_first_made_smaller_and_keeps_its_place(wavy, monkeypatch):
    """By another library, in float32: far from the origin that must not show, and every face must be there once."""
    monkeypatch.setattr(simplify, "LARGE", 4000)
    found = simplified(wavy, faces=1500)
    assert len(found.mesh.faces) == pytest.approx(1500, abs=2)
    assert found.mean_m < 0.0005 and found.most_m < 0.005
    assert found.mesh.area == pytest.approx(wavy.area, rel=0.02)
    red = np.asarray(found.mesh.visual.vertex_colors)[:, 0] / 255
    assert np.abs(red - (found.mesh.vertices[:, 0] - 50)).max() < 0.03


def test_a_missing_part_is_an_error(wavy):
    part = trimesh.Trimesh(wavy.vertices, wavy.faces[wavy.triangles_center[:, 0] < 50.7], process=False)
    assert measured(wavy, part).largest_m == pytest.approx(0.3, abs=0.02)


@pytest.fixture
def punched(make) -> trimesh.Trimesh:
    """A room of 10 cm faces, wound to its inside, without its ceiling and with a hole of 40 cm in the floor."""
    room = make.room(spacing=0.1, without=("ceiling",))
    room.merge_vertices()
    middle = room.triangles_center
    hole = (np.abs(middle[:, :2]) < 0.2).all(axis=1) & (middle[:, 2] < -1.2)
    room.update_faces(~hole)
    inward = np.einsum("ni,ni->n", room.face_normals, room.triangles_center) < 0
    faces = np.where(inward[:, None], room.faces, room.faces[:, ::-1])
    return trimesh.Trimesh(room.vertices, faces, process=False, vertex_colors=np.full((len(room.vertices), 3), 77))


def test_small_holes_are_filled_and_large_ones_stay(punched):
    filled = holes_filled(punched, 1.0)
    assert filled.area == pytest.approx(punched.area + 0.16, rel=0.01)
    assert (filled.visual.vertex_colors[:, 0] == 77).all()
    rim = trimesh.grouping.group_rows(filled.edges_sorted, require_count=1)
    assert (filled.vertices[filled.edges[rim]][..., 2] > 1.2).all()  # only the ceiling is open


def test_watertight_closes_the_missing_ceiling_and_still_faces_inward(punched):
    closed = watertight(punched, 0.05)
    assert closed.is_watertight
    assert closed.volume < 0  # wound to the inside
    assert -closed.volume == pytest.approx(4 * 3 * 2.5, rel=0.02)
