"""Cleaning keeps the surface and nothing else, in an order of its own."""

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.mesh.clean import clean


def two_boxes_and_a_speck() -> trimesh.Trimesh:
    big = trimesh.creation.box((1, 1, 1)).subdivide()
    small = trimesh.creation.box((1, 1, 1))
    small.apply_translation([3, 0, 0])
    speck = trimesh.Trimesh([[9, 0, 0], [9, 1, 0], [9, 0, 1]], [[0, 1, 2]], process=False)
    return trimesh.util.concatenate([speck, small, big])


def test_small_pieces_go():
    mesh = clean(two_boxes_and_a_speck(), min_triangles=12)
    assert len(mesh.faces) == 48 + 12
    assert mesh.vertices[:, 0].max() < 9


def test_only_the_largest_pieces_stay():
    mesh = clean(two_boxes_and_a_speck(), keep_clusters=1)
    assert len(mesh.faces) == 48
    assert len(mesh.vertices) == 26


def test_unfit_faces_go_and_twins_merge():
    vertices = [
        [0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0],  # a square
        [1, 0, 0],  # twin of vertex 1
        [np.nan, 0, 0], [7, 7, 7],  # not finite; unused
        [0.5, 0, 0],
    ]  # fmt: skip
    faces = [[0, 1, 2], [4, 3, 2], [2, 0, 1], [0, 2, 1], [0, 1, 4], [0, 7, 1], [0, 1, 5]]
    colors = np.full((8, 4), 255, np.uint8)
    colors[:, 0] = np.arange(8) * 10
    mesh = clean(trimesh.Trimesh(vertices, faces, vertex_colors=colors, process=False))
    assert np.isfinite(mesh.vertices).all()
    assert len(mesh.vertices) == 4
    assert len(mesh.faces) == 2
    assert mesh.area == 1.0
    square = {tuple(v): c[0] for v, c in zip(mesh.vertices, mesh.visual.vertex_colors, strict=True)}
    assert square == {(0, 0, 0): 0, (1, 0, 0): 40, (0, 1, 0): 20, (1, 1, 0): 30}


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_the_order_of_the_input_does_not_matter_and_winding_stays(seed):
    mesh = trimesh.creation.icosphere(subdivisions=2)
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    faces = np.argsort(order)[mesh.faces][rng.permutation(len(mesh.faces))]
    faces = np.stack([np.roll(face, rng.integers(3)) for face in faces])
    shuffled = trimesh.Trimesh(mesh.vertices[order], faces, process=False)
    a, b = clean(mesh), clean(shuffled)
    assert np.array_equal(a.vertices, b.vertices)
    assert np.array_equal(a.faces, b.faces)
    assert np.isclose(a.volume, mesh.volume)  # signed: negative if the winding turned


def test_a_mesh_without_faces_stays_empty():
    assert len(clean(trimesh.Trimesh(process=False), 10, 3).faces) == 0
