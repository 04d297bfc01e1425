"""As few faces as a surface needs: flat walls get large ones, rims and pictures keep theirs.

Quadric decimation by fast-simplification (MIT), which is single-threaded and leaves the vertices of open rims where
they are to the last bit. So nothing shrinks at a hole, and parts that are decimated one by one, or are set aside, for
they show an edge of colour, fit together without a crack.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import fast_simplification
import numpy as np
import trimesh

from room2dgs.freed_memory import give_back
from room2dgs.geometry.arguments import number
from room2dgs.mesh.checks import check_mesh
from room2dgs.mesh.clean import clean
from room2dgs.mesh.simplify import Measure, Simplified, colors_at
from room2dgs.mesh.vertex_colors import vertex_colors

CONTRAST = 24  # levels between the corners of a face, above which it stays: vertices hold all the colour there is
FIRST = 0.25  # of the faces, tried first
TRIES = 4
NEAR_ENOUGH = 0.75  # of the bound
AIM = 0.9  # of the bound
LEAST = 0.1  # of the bound: what is nearer counts as this far
SLOPE, SLOPES = 0.3, (0.1, 2.0)  # faces fall with the error to about this power, of a room's smoothed mesh; bounds
AGGRESSION = 3.0  # of fast-simplification; with more it is sooner done, and coarser where shape is
SMALL = 500  # faces, which are few enough
PART = 400_000  # faces that are decimated at a time; memory follows them
FEWEST_TRIED, MOST_TRIED = 0.02, 0.7  # of a part's faces, whatever its neighbour needed


def decimation(mesh: trimesh.Trimesh, max_error_m: float) -> Simplified:
    """The fewest faces found whose surface is the mesh's within the bound; the same bytes on any number of threads.

    A large mesh is taken in parts: each gets as few faces as its own shape allows, and memory follows the largest part.

    Args:
        mesh: cleaned (`clean`); with vertex colours or without.
        max_error_m: for 99.9 % of both surfaces of each part, as `simplify` measures it.

    Returns:
        The mesh as it is, if it is small or nothing within the bound was found. `most_m` is the worst part's.

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be; no such number.
    """
    check_mesh(mesh)
    number("max_error_m", max_error_m, above=0.0)
    vertices, faces, aside = np.asarray(mesh.vertices), np.asarray(mesh.faces), _contrasting(mesh)
    pieces, share = [_piece(vertices, faces[aside])], FIRST
    found = []
    for rows in _parts(vertices, faces, np.flatnonzero(~aside)):
        part = _searched(*_piece(vertices, faces[rows]), max_error_m, share)
        if len(part.mesh.faces) < len(rows):
            share = float(np.clip(len(part.mesh.faces) / len(rows), FEWEST_TRIED, MOST_TRIED))  # neighbours are alike
        pieces.append((np.asarray(part.mesh.vertices), np.asarray(part.mesh.faces)))
        found.append((part.largest_m, part.most_m, part.mean_m, len(rows)))
        give_back()  # what the tries have left
    largest, most, mean, counts = np.array(found).reshape(-1, 4).T
    if sum(len(piece[1]) for piece in pieces) == len(faces):
        return Simplified(mesh, 0.0, 0.0, 0.0)
    sewn = _sewn(_together(pieces), mesh)
    return Simplified(sewn, float(largest.max()), float(most.max()), float(np.average(mean, weights=counts)))


def _searched(vertices: np.ndarray, faces: np.ndarray, max_error_m: float, share: float) -> Simplified:
    """A part with the fewest faces found; as it is, if it is small or nothing within the bound was found."""
    whole = trimesh.Trimesh(vertices, faces, process=False)
    best = Simplified(whole, 0.0, 0.0, 0.0)
    if len(faces) <= SMALL:
        return best
    measure = Measure(whole)
    target, refused, done = share * len(faces), 0.0, float(len(faces))
    tries: list[tuple[float, float]] = []  # faces, and their error as a share of the bound
    while len(tries) < TRIES:
        # From the whole each time: a mesh that was decimated once has forgotten where its surface was.
        tried = fast_simplification.simplify(
            vertices, faces.astype(np.int32), target_count=int(target), agg=AGGRESSION, preserve_border=True
        )
        found = measure(trimesh.Trimesh(tried[0], tried[1], process=False))
        reached, ratio = float(len(tried[1])), round(found.most_m, 6) / max_error_m  # in micrometres: no less decides
        tries.append((reached, max(ratio, LEAST)))
        if ratio > 1:
            refused = max(refused, reached)
        elif reached < done:
            best, done = found, reached
        if ratio <= 1 and (ratio > NEAR_ENOUGH or reached > 1.1 * target):  # rims and what is curved allow no fewer
            break
        # between what was too few and what is known to do
        target = np.clip(_next(tries), max(1.05 * refused, SMALL), 0.95 * done)
        if not refused < target < 0.96 * done:
            break
    return best


def _next(tries: Sequence[tuple[float, float]]) -> float:
    """Faces whose error is a little below the bound: a power law through the last two of the tries."""
    faces, error = tries[-1]
    slope = SLOPE
    if len(tries) > 1 and error != tries[-2][1] and faces != tries[-2][0]:
        slope = float(np.log(faces / tries[-2][0]) / np.log(tries[-2][1] / error))
    return faces * (error / AIM) ** float(np.clip(slope, *SLOPES))


def _parts(vertices: np.ndarray, faces: np.ndarray, rows: np.ndarray) -> Iterator[np.ndarray]:
    """Rows of faces that lie together, rising, at most `PART` each: halves of halves, across the longest side."""
    if len(rows) <= PART:
        yield rows
        return
    for half in _halves(vertices, faces, rows):
        yield from _parts(vertices, faces, half)


def _halves(vertices: np.ndarray, faces: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows on either side of their middle, across the longest side; a function, for what it needs is much."""
    middles = [sum(axis[faces[rows, corner]] for corner in range(3)) for axis in vertices.T]
    order = np.argsort(max(middles, key=np.ptp), kind="stable")
    return np.sort(rows[order[: len(order) // 2]]), np.sort(rows[order[len(order) // 2 :]])


def _piece(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The faces with the vertices that they use, in their order."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    renumbered = np.cumsum(used) - 1
    return vertices[used], renumbered[faces]


def _contrasting(mesh: trimesh.Trimesh) -> np.ndarray:
    """(F,) bool."""
    colors = vertex_colors(mesh)
    if colors is None:
        return np.zeros(len(mesh.faces), dtype=bool)
    corners = colors[:, :3].astype(np.int16)[np.asarray(mesh.faces)]
    return (corners.max(axis=1) - corners.min(axis=1)).max(axis=1) > CONTRAST


def _together(pieces: Sequence[tuple[np.ndarray, np.ndarray]]) -> trimesh.Trimesh:
    """All pieces as one mesh, each with vertices of its own."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    faces = [piece[1] + first for piece, first in zip(pieces, firsts[:-1], strict=True)]
    return trimesh.Trimesh(np.concatenate([piece[0] for piece in pieces]), np.concatenate(faces), process=False)


def _sewn(parts: trimesh.Trimesh, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """One mesh, joined where vertices are the same, with the whole mesh's colours."""
    joined = clean(parts)
    if vertex_colors(mesh) is not None:
        joined.visual = trimesh.visual.ColorVisuals(joined, vertex_colors=colors_at(mesh, np.asarray(joined.vertices)))
    return joined
