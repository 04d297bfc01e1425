"""A mesh and a truth of two units or worlds are told."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from room2dgs.errors import InputError
from room2dgs.eval.placement import check_together, misplaced
from room2dgs.eval.protocol import load
from room2dgs.mesh.io import write_mesh


def room(scale: float = 1.0, moved=(0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((4.5, 3.5, 2.6)).subdivide().subdivide().subdivide()
    mesh.apply_scale(scale)
    mesh.apply_translation(moved)
    return mesh


@pytest.mark.parametrize(("scale", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres"), (39.37, "inches")])
def test_a_truth_in_another_unit(scale, unit):
    said = misplaced(room(), room(scale))
    assert (
        said == f"the ground truth is {scale:,.0f} times as large as the mesh: it looks like {unit}; write it in metres"
    )
    assert misplaced(room(scale), room()).startswith(f"the mesh is {scale:,.0f} times as large as the ground truth")


def test_a_truth_in_another_place():
    assert misplaced(room(), room(moved=(20.0, 0, 0))).startswith("the mesh and the ground truth lie 15.")
    assert misplaced(room(), room(moved=(3.0, 1.0, 0))) is None


def test_strays_and_parts_of_a_room_are_no_doubt():
    stray = trimesh.creation.icosahedron()
    stray.apply_translation((5000.0, 0, 0))
    assert misplaced(trimesh.util.concatenate([room(), room(), room(), stray]), room()) is None
    assert misplaced(room(0.2), room(2.0)) is None


def test_meshes_without_a_size_are_no_doubt():
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert misplaced(flat, room()) is None


def with_far_vertex(metres: float) -> trimesh.Trimesh:
    mesh = room()
    mesh.vertices = np.where(np.arange(len(mesh.vertices))[:, None] == 5, metres, mesh.vertices)
    return mesh


@pytest.mark.parametrize("metres", [2e4, 1e8, -1e11])
def test_a_vertex_that_is_far_away_is_told_before_it_takes_the_rooms_millimetres(tmp_path, metres):
    mesh = with_far_vertex(metres)
    with pytest.raises(InputError, match=r"^the mesh has \d of 768 faces that reach up to .* m away from the rest"):
        load(mesh)
    write_mesh(tmp_path / "a.ply", mesh)
    with pytest.raises(InputError, match=r"a\.ply has \d of 768 faces that reach"):
        load(tmp_path / "a.ply")


@pytest.mark.parametrize("mesh", [room(), room(1e4), room(1.0, (5e5, 5e6, 0)), with_far_vertex(500.0)])
def test_rooms_in_any_unit_and_place_are_together(mesh):
    check_together(mesh, "a")
    check_together(trimesh.Trimesh(mesh.vertices, np.zeros((0, 3), int), process=False), "a")
