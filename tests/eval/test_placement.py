"""A mesh and a truth of two units or worlds are told."""

from __future__ import annotations

import pytest
import trimesh

from room2dgs.eval.placement import misplaced


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
