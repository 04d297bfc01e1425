"""As few faces as a surface needs: flat walls get large ones, rims and pictures keep theirs.

Edges collapse by quadric error (`collapse`), no vertex moves, and open rims stay to the last bit. So nothing shrinks at
a hole, and parts that are simplified one by one, or are set aside, for they show an edge of colour, fit together
without a crack.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import trimesh

from room2dgs.mesh.clean import clean
from room2dgs.mesh.collapse import collapsed
from room2dgs.mesh.simplify import Measure, Simplified

CONTRAST = 24  # levels between the corners of a face, above which it stays: vertices hold all the colour there is
FIRST = 0.45  # quadric error tried first, of the bound: what 99.9 % of a room's mesh is off by is about twice as much
TRIES = 4
NEAR_ENOUGH = 0.65  # of the bound
AIM = 0.85  # of the bound
LEAST = 0.1  # of the bound: what is nearer counts as this far
POWER = 0.8  # by which the quadric error follows the distance
SMALL = 500  # faces, which are few enough
PART = 400_000  # faces that are simplified at a time; memory follows them


def few_faces(mesh: trimesh.Trimesh, max_error_m: float) -> Simplified:
    """The fewest faces found whose surface is the mesh's within the bound; the same bytes on any number of threads.

    A large mesh is taken in parts: each gets as few faces as its own shape allows, and memory follows the largest part.

    Args:
        mesh: cleaned (`clean`); with vertex colours or without.
        max_error_m: for 99.9 % of both surfaces of each part, as `simplify` measures it.

    Returns:
        The mesh as it is, if it is small or nothing within the bound was found. `most_m` is the worst part's.
    """
    vertices, faces, aside = np.asarray(mesh.vertices), np.asarray(mesh.faces), _contrasting(mesh)
    pieces, found, share = [faces[aside]], [], FIRST
    for rows in _parts(vertices, faces, np.flatnonzero(~aside)):
        if len(rows) <= SMALL:
            pieces.append(faces[rows])
            continue
        used, part = _piece(faces[rows])
        less, share = _searched(trimesh.Trimesh(vertices[used], part, process=False), max_error_m, share)
        pieces.append(used[less.faces])
        found.append((less.largest_m, less.most_m, less.mean_m, len(rows)))
    left = np.concatenate(pieces)
    if len(left) == len(faces):
        return Simplified(mesh, 0.0, 0.0, 0.0)
    largest, most, mean, counts = np.array(found).T
    mean_m = float(np.average(mean, weights=counts))
    return Simplified(_with_faces(mesh, left), float(largest.max()), float(most.max()), mean_m)


class _Less(NamedTuple):
    """(F, 3) faces that are left of a part, and how far they are off, as `Simplified`."""

    faces: np.ndarray
    largest_m: float
    most_m: float
    mean_m: float


def _searched(whole: trimesh.Trimesh, max_error_m: float, share: float) -> tuple[_Less, float]:
    """The fewest faces found, all of them where nothing within the bound was, and the quadric error to try next time.

    Args:
        whole: a part.
        share: quadric error to try first, of the bound; what is returned, too.
    """
    vertices, faces, measure = np.asarray(whole.vertices), np.asarray(whole.faces), Measure(whole)
    best, refused, before = _Less(faces, 0.0, 0.0, 0.0), np.inf, len(faces) + 1
    for _ in range(TRIES):
        # From the whole each time: a mesh that was simplified once has forgotten where its surface was.
        left = collapsed(vertices, faces, error_m=share * max_error_m, rims_stay=True)
        if len(left) == before:  # rims and what is curved allow no fewer
            break
        before = len(left)
        used, part = _piece(left)
        found = measure(trimesh.Trimesh(vertices[used], part, process=False))
        ratio = round(found.most_m, 6) / max_error_m  # in micrometres: no less decides
        tried, share = share, share * (AIM / max(ratio, LEAST)) ** POWER
        if ratio > 1:
            refused = min(refused, tried)
        elif len(left) < len(best.faces):
            best = _Less(left, found.largest_m, found.most_m, found.mean_m)
            if ratio > NEAR_ENOUGH:
                break
        share = min(share, 0.95 * refused)
    return best, share


def _parts(vertices: np.ndarray, faces: np.ndarray, rows: np.ndarray) -> Iterator[np.ndarray]:
    """Rows of faces that lie together, rising, at most `PART` each: halves of halves, across the longest side."""
    if len(rows) <= PART:
        yield rows
        return
    middles = vertices[faces[rows, 0]] + vertices[faces[rows, 1]] + vertices[faces[rows, 2]]
    along = middles[:, np.ptp(middles, axis=0).argmax()]
    order = np.argsort(along, kind="stable")
    for half in (order[: len(order) // 2], order[len(order) // 2 :]):
        yield from _parts(vertices, faces, rows[np.sort(half)])


def _piece(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertices that the faces use, rising, and the faces renumbered to these."""
    used = np.zeros(faces.max(initial=-1) + 1, dtype=bool)
    used[faces] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1)[faces]


def _contrasting(mesh: trimesh.Trimesh) -> np.ndarray:
    """(F,) bool."""
    if mesh.visual.kind != "vertex":
        return np.zeros(len(mesh.faces), dtype=bool)
    colors = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.int16)
    a, b, c = (colors[np.asarray(mesh.faces)[:, corner]] for corner in range(3))
    spread = np.maximum(np.maximum(a, b), c) - np.minimum(np.minimum(a, b), c)
    return np.maximum(np.maximum(spread[:, 0], spread[:, 1]), spread[:, 2]) > CONTRAST


def _with_faces(mesh: trimesh.Trimesh, faces: np.ndarray) -> trimesh.Trimesh:
    """The mesh with other faces of its vertices."""
    used, renumbered = _piece(faces)
    colors = np.asarray(mesh.visual.vertex_colors)[used] if mesh.visual.kind == "vertex" else None
    return clean(trimesh.Trimesh(np.asarray(mesh.vertices)[used], renumbered, vertex_colors=colors, process=False))
