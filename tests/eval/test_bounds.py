"""Meshes in another unit, and options that cannot be: a sentence before the memory or the hour is gone."""

from __future__ import annotations

import time

import numpy as np
import pytest
import trimesh

from room2dgs.errors import InputError
from room2dgs.eval import evaluate
from room2dgs.eval.alignment_search import guesses
from room2dgs.eval.geometry_scores import downsample
from room2dgs.eval.protocol import MeshFile
from room2dgs.eval.protocol_neuris import DOWNSAMPLE_M, _fine, neuris, too_many_pieces
from room2dgs.eval.sampling import sample_by_area
from room2dgs.eval.surface import Surface


def box(side: float) -> trimesh.Trimesh:
    return trimesh.creation.box((side, side, side))


@pytest.mark.parametrize("side", [4000.0, 1e9])
def test_neuris_does_not_cut_a_mesh_in_millimetres(make, side):
    start = time.perf_counter()
    with pytest.raises(InputError, match=r"area of .* m2.*millimetres.*eval\.protocols"):
        neuris(MeshFile(box(side)), MeshFile(box(4.0)), make.all_around(), make.options())
    assert time.perf_counter() - start < 5


@pytest.mark.parametrize("corner", [(0.7, 1.3), (0.01, 0.02), (0.75, 0.004), (-3.0, 0.3), (1.5, 1.5), (0.0, 0.05)])
def test_the_number_of_pieces_is_known_before_they_are_made(corner):
    mesh = trimesh.Trimesh([[0, 0, 0], [1.5, 0, 0], [*corner, 0]], [[0, 1, 2]], process=False)
    fine = _fine(MeshFile(mesh))
    assert fine.area == pytest.approx(mesh.area) and fine.edges_unique_length.max() <= DOWNSAMPLE_M
    for twice in (mesh, trimesh.util.concatenate([mesh, mesh])):  # by their numbers, and by what a part comes to
        count = len(fine.faces) * len(twice.faces)
        longest = np.repeat(mesh.edges_unique_length.max(), len(twice.faces))
        assert not too_many_pieces(twice.vertices, twice.faces, longest, count)
        assert too_many_pieces(twice.vertices, twice.faces, longest, count - 1)


def test_cells_that_have_no_numbers_are_told_apart():
    near = np.random.default_rng(0).uniform(0, 0.1, (200, 3))
    expected = downsample(near, 0.02)
    far = downsample(np.concatenate([near, [[1e9, 1e9, 1e9]]]), 0.02)
    assert np.allclose(far[:-1], expected) and np.allclose(far[-1], 1e9)


def test_the_search_over_all_turns_is_of_rooms():
    rng = np.random.default_rng(0)
    normals = np.repeat(np.eye(3), 100, axis=0)
    points = rng.uniform(0, 4, (300, 3))
    assert guesses(points, normals, points, normals, False)
    with pytest.raises(InputError, match="millimetres"):
        guesses(points, normals, points * 1000, normals, False)


@pytest.mark.parametrize(
    "options",
    [{"samples": 0}, {"samples": 10**12}, {"samples": 2.5}, {"threshold_m": 0.0}, {"threshold_m": float("nan")},
     {"threshold_m": float("inf")}, {"threshold_m": -1.0}],
)  # fmt: skip
def test_options_that_cannot_be_are_told(make, options):
    (name,) = options
    with pytest.raises(InputError, match=name):
        evaluate(box(1.0), box(1.0), make.all_around(), **options)


@pytest.mark.parametrize("vertex", [-1, 8, 2**40])
def test_meshes_given_from_python_are_checked(make, vertex):
    """A face with a vertex that is not there was read past the end of the mesh."""
    wrong = box(1.0)
    faces = np.array(wrong.faces)
    faces[3, 1] = vertex
    wrong = trimesh.Trimesh(wrong.vertices, faces, process=False)
    doors = (
        Surface,
        lambda mesh: sample_by_area(mesh, 10, 0),
        lambda mesh: evaluate(mesh, box(1.0), make.all_around()),
    )
    for run in doors:
        with pytest.raises(ValueError, match="faces name vertices"):
            run(wrong)
        with pytest.raises(TypeError, match=r"trimesh\.Trimesh"):
            run(None)
