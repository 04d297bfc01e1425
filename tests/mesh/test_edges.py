"""Edges are each there once, with the faces that they are of, and a surface without a rim is closed."""

from collections import Counter

import numpy as np
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.mesh.edges import edges_and_faces, is_closed

CORNERS = st.lists(st.integers(0, 11), min_size=3, max_size=3, unique=True)


@given(faces=st.lists(CORNERS, max_size=30))
def test_edges_are_those_of_the_faces(faces):
    edges, count = edges_and_faces(np.array(faces, np.int64).reshape(-1, 3), 12)
    sides = Counter(tuple(sorted((face[k], face[k - 1]))) for face in faces for k in range(3))
    assert list(map(tuple, edges.tolist())) == sorted(sides)
    assert count.tolist() == [sides[tuple(edge)] for edge in edges.tolist()]


def test_a_box_is_closed_and_one_without_a_face_or_with_one_more_is_not():
    box = trimesh.creation.box()
    assert is_closed(box.faces, len(box.vertices))
    assert not is_closed(box.faces[1:], len(box.vertices))
    assert not is_closed(np.concatenate([box.faces, box.faces[:1]]), len(box.vertices))
    assert not is_closed(box.faces[:0], len(box.vertices))
