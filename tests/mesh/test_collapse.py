"""Edges collapse to their ends, rims stay, and no crack is left where rims are straight."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.mesh.collapse import collapsed, has_area
from tests.mesh.test_few_faces import rim


def grid(columns: int, rows: int, degrees: float, hole_m: float = 0.0) -> trimesh.Trimesh:
    """Level squares of 10 cm, turned, with a round hole: the rims run straight along sides and diagonals but for
    rounding."""
    x, y = np.meshgrid(np.arange(columns + 1) / 10, np.arange(rows + 1) / 10, indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    p, q, r, s = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    middle = np.stack([x, y], axis=-1).reshape(-1, 2)[faces].mean(axis=1) - [columns / 20, rows / 20]
    faces = faces[np.hypot(*middle.T) >= hole_m]
    floor = trimesh.Trimesh(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces, process=False)
    return floor.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), [0, 0, 1]))


@pytest.fixture(scope="module")
def floor() -> trimesh.Trimesh:
    return grid(30, 20, 20)


@settings(max_examples=40, deadline=None)
@given(st.integers(10, 40), st.integers(10, 40), st.sampled_from([0, 20, 45, 73.3]), st.floats(0.1, 0.4))
def test_a_floor_with_a_hole_keeps_its_rims_and_has_no_crack(columns, rows, degrees, hole_m):
    floor = grid(columns, rows, degrees, hole_m)
    left = collapsed(floor.vertices, floor.faces, error_m=0.01, rims_stay=True)
    found = trimesh.Trimesh(floor.vertices, left, process=False)
    assert has_area(np.asarray(floor.vertices), left).all()
    np.testing.assert_array_equal(rim(found), rim(floor))
    assert len(left) <= 1.3 * len(rim(floor))  # as many faces as corners join two rims
    assert found.area == pytest.approx(floor.area)
    assert (found.face_normals[:, 2] > 0.999).all()


def test_without_rims_to_keep_it_ends_at_the_number_of_faces(floor):
    assert len(collapsed(floor.vertices, floor.faces, least=600, rims_stay=False)) == pytest.approx(600, abs=2)
    assert len(collapsed(floor.vertices, floor.faces, rims_stay=False)) < 20
    assert len(collapsed(floor.vertices, floor.faces[:0], rims_stay=True)) == 0


def test_the_error_bounds_what_is_lost():
    ridge = trimesh.creation.icosphere(subdivisions=5, radius=1.0)
    few, many = (
        trimesh.Trimesh(ridge.vertices, collapsed(ridge.vertices, ridge.faces, error_m=error, rims_stay=True))
        for error in (0.01, 0.001)
    )
    assert len(few.faces) < 0.4 * len(many.faces) < 0.4 * len(ridge.faces)
    assert np.linalg.norm(few.triangles_center, axis=1).min() > 0.95
    assert np.linalg.norm(many.triangles_center, axis=1).min() > 0.99
