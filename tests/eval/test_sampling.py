"""Area samples: right shares, right places, repeatable."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.eval.sampling import sample_by_area


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.integers(100, 3000))
def test_every_face_gets_its_share_and_samples_lie_on_their_face(seed, count):
    mesh = trimesh.creation.icosphere(subdivisions=1)
    mesh.vertices *= [1, 2, 0.3]
    samples = sample_by_area(mesh, count, seed)
    assert len(samples.points) == count
    expected = mesh.area_faces / mesh.area * count
    got = np.bincount(samples.triangle, minlength=len(mesh.faces))
    assert np.abs(got - expected).max() < 2  # stratified: a face's ends may each gain or lose one
    barycentric = trimesh.triangles.points_to_barycentric(mesh.triangles[samples.triangle], samples.points)
    assert barycentric.min() > -1e-9


def test_samples_are_uniform_within_a_triangle():
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    points = sample_by_area(mesh, 40_000, 0).points
    assert points.mean(axis=0)[:2] == pytest.approx([1 / 3, 1 / 3], abs=0.005)
    assert (points[:, 0] < 0.5).mean() == pytest.approx(0.75, abs=0.01)


def test_seeds():
    mesh = trimesh.creation.box()
    a, b, c = (sample_by_area(mesh, 100, seed).points for seed in (1, 1, 2))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


def test_no_area_gives_no_samples():
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False)
    assert len(sample_by_area(flat, 100, 0).points) == 0
    assert len(sample_by_area(trimesh.Trimesh(), 100, 0).points) == 0
