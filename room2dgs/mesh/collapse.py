"""Edge collapse by quadric error, meshoptimizer's (MIT): no vertex moves, so that what is left keeps its colours."""

from __future__ import annotations

import numpy as np
from meshoptimizer import SIMPLIFY_ERROR_ABSOLUTE, SIMPLIFY_LOCK_BORDER, simplify

THIN = 1e-6  # height of a face, of its longest side, at which it has no area


def collapsed(
    vertices: np.ndarray, faces: np.ndarray, *, least: int = 0, error_m: float = np.inf, rims_stay: bool
) -> np.ndarray:
    """The faces that are left when edges collapse to one of their ends, the cheapest first.

    The same input gives the same faces.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3) into the vertices.
        least: faces at which it ends.
        error_m: and the quadric error at which it does: about half of the distance that 99.9 % of the surface then has.
        rims_stay: open edges are where they were, to the last bit.

    Returns:
        (F', 3) into the same vertices, each with an area.
    """
    if not len(faces):
        return faces
    middle = vertices.mean(axis=0)  # it works in float32
    left = np.empty(faces.size, np.uint32)
    count = simplify(
        left,
        np.ascontiguousarray(faces, np.uint32).ravel(),
        np.ascontiguousarray(vertices - middle, np.float32),
        target_index_count=3 * least,
        target_error=float(min(error_m, np.finfo(np.float32).max)),
        options=SIMPLIFY_ERROR_ABSOLUTE | (SIMPLIFY_LOCK_BORDER if rims_stay else 0),
    )
    return _with_an_area(vertices, left[:count].reshape(-1, 3).astype(faces.dtype))


def has_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) bool: whether the corners are off one line by more than `THIN` of the longest side."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    sides = [((end - start) ** 2).sum(axis=1) for start, end in ((a, b), (b, c), (c, a))]
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) > THIN * np.max(sides, axis=0)


def _with_an_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The same surface without faces whose corners lie on one line, as collapses leave some where rims are straight.

    Without such a face alone, its middle corner would lie on an edge of the face beside it: a crack. So that one is
    divided there.
    """
    flat = ~has_area(vertices, faces)
    if not flat.any():
        return faces
    near = np.isin(faces, faces[flat]).any(axis=1)
    near = np.isin(faces, faces[near]).any(axis=1)  # and those beside them, which may be divided in turn
    some = {index: tuple(map(int, faces[index])) for index in np.flatnonzero(near)}
    beside = {edge: index for index, face in some.items() for edge in _edges(face)}
    to_do = [int(index) for index in np.flatnonzero(flat)]
    for _ in range(8 * len(to_do)):  # a fan of them on one line takes some turns
        if not to_do:
            break
        index = to_do.pop()
        if has_area(vertices, np.array([some[index]]))[0]:  # since it was divided with another one
            continue
        u, v, w = _longest_first(vertices, some[index])
        other = beside.get((v, u))
        for edge in _edges(some.pop(index)):
            beside.pop(edge, None)
        if other is None:  # at a rim, which is w's two edges again
            continue
        d = next(corner for corner in some[other] if corner not in (u, v))
        for edge in _edges(some.pop(other)):
            beside.pop(edge, None)
        for place, face in ((index, (v, w, d)), (other, (w, u, d))):
            some[place] = face
            beside.update({edge: place for edge in _edges(face)})
            if not has_area(vertices, np.array([face]))[0] and place not in to_do:
                to_do.append(place)
    return np.concatenate([faces[~near], np.array([some[index] for index in sorted(some)], faces.dtype).reshape(-1, 3)])


def _edges(face: tuple[int, ...]) -> list[tuple[int, int]]:
    return [(face[corner], face[(corner + 1) % 3]) for corner in range(3)]


def _longest_first(vertices: np.ndarray, face: tuple[int, ...]) -> tuple[int, int, int]:
    """The corners in their order, beginning with the longest side."""
    lengths = [float(((vertices[u] - vertices[v]) ** 2).sum()) for u, v in _edges(face)]
    first = int(np.argmax(lengths))
    return face[first], face[(first + 1) % 3], face[(first + 2) % 3]
