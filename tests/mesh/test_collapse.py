"""Edges collapse to their ends, rims stay, and no crack is left where rims are straight."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from room2dgs.mesh.collapse import collapsed, has_area
from tests.mesh.test_few_faces import rim


@pytest.fixture(scope="module")
def floor() -> trimesh.Trimesh:
    """3 m by 2 m in squares of 10 cm, level and turned by 20 degrees: its rims are straight but for rounding."""
    x, y = np.meshgrid(np.arange(31) / 10, np.arange(21) / 10, indexing="ij")
    index = np.arange(31 * 21).reshape(31, 21)
    p, q, r, s = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    floor = trimesh.Trimesh(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces, process=False)
    return floor.apply_transform(trimesh.transformations.rotation_matrix(np.radians(20), [0, 0, 1]))


def test_a_floor_keeps_its_rim_and_is_divided_at_each_of_its_corners(floor):
    left = collapsed(floor.vertices, floor.faces, error_m=0.01, rims_stay=True)
    found = trimesh.Trimesh(floor.vertices, left, process=False)
    assert has_area(np.asarray(floor.vertices), left).all()
    np.testing.assert_array_equal(rim(found), rim(floor))
    assert len(left) < 1.3 * 100  # 100 corners on the rim need 98
    assert found.area == pytest.approx(6)
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
