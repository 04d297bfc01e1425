"""As few faces as a surface needs: flat walls get large ones, rims and pictures keep theirs.

Quadric decimation by fast-simplification (MIT), which is single-threaded and leaves the vertices of open rims where
they are to the last bit. So nothing shrinks at a hole, and faces that are set aside, for they show an edge of colour,
fit back without a crack.
"""

from __future__ import annotations

from dataclasses import replace

import fast_simplification
import numpy as np
import trimesh

from room2dgs.mesh.clean import clean
from room2dgs.mesh.simplify import Measure, Simplified, colors_at

CONTRAST = 24  # levels between the corners of a face, above which it stays: vertices hold all the colour there is
FIRST = 0.25  # of the faces, tried first
TRIES = 3
NEAR_ENOUGH = 0.85  # of the bound
SLOPE = 0.8  # faces fall with the error to about this power
AGGRESSION = 3.0  # of fast-simplification; with more it is sooner done, and coarser where shape is
SMALL = 500  # faces, which are few enough


def few_faces(mesh: trimesh.Trimesh, max_error_m: float) -> Simplified:
    """The fewest faces found whose surface is the mesh's within the bound; the same bytes on any number of threads.

    Args:
        mesh: cleaned (`clean`); with vertex colours or without.
        max_error_m: for 99.9 % of both surfaces, as `simplify` measures it.

    Returns:
        The mesh as it is, if it is small or nothing within the bound was found.
    """
    best = Simplified(mesh, 0.0, 0.0, 0.0)
    faces, aside = np.asarray(mesh.faces), _contrasting(mesh)
    shown, plain = faces[aside], faces[~aside]
    if len(plain) <= SMALL:
        return best
    whole = Measure(mesh)
    target, refused, done = FIRST * len(plain), 0.0, float(len(plain))
    for _ in range(TRIES):
        # From the whole each time: a mesh that was decimated once has forgotten where its surface was.
        tried = _decimated(np.asarray(mesh.vertices), plain, int(target))
        found = whole(_together(mesh, tried, shown))
        ratio = round(found.most_m, 6) / max_error_m  # in micrometres: nothing is decided by less
        reached = float(len(tried[1]))
        if ratio > 1:
            refused = max(refused, reached)
        elif reached < done:
            best, done = found, reached
        if ratio <= 1 and (ratio > NEAR_ENOUGH or reached > 1.1 * target):  # rims and what is curved allow no fewer
            break
        # between what was too few and what is known to do
        target = np.clip(reached * max(ratio, 0.1) ** SLOPE, max(1.05 * refused, SMALL), 0.95 * done)
        if not refused < target < 0.96 * done:
            break
    return best if best.mesh is mesh else replace(best, mesh=_sewn(best.mesh, mesh))


def _contrasting(mesh: trimesh.Trimesh) -> np.ndarray:
    """(F,) bool."""
    if mesh.visual.kind != "vertex":
        return np.zeros(len(mesh.faces), dtype=bool)
    corners = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.int16)[np.asarray(mesh.faces)]
    return (corners.max(axis=1) - corners.min(axis=1)).max(axis=1) > CONTRAST


def _decimated(vertices: np.ndarray, faces: np.ndarray, target: int) -> tuple[np.ndarray, np.ndarray]:
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    renumbered = (np.cumsum(used) - 1).astype(np.int32)
    return fast_simplification.simplify(
        vertices[used], renumbered[faces], target_count=target, agg=AGGRESSION, preserve_border=True
    )


def _together(mesh: trimesh.Trimesh, plain: tuple[np.ndarray, np.ndarray], shown: np.ndarray) -> trimesh.Trimesh:
    """Both parts as one mesh, each with vertices of its own."""
    used, numbers = np.unique(shown, return_inverse=True)
    vertices = np.concatenate([plain[0], np.asarray(mesh.vertices)[used]])
    return trimesh.Trimesh(vertices, np.concatenate([plain[1], numbers.reshape(-1, 3) + len(plain[0])]), process=False)


def _sewn(parts: trimesh.Trimesh, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """One mesh, joined where vertices are the same, with the whole mesh's colours."""
    joined = clean(parts)
    if mesh.visual.kind == "vertex":
        joined.visual = trimesh.visual.ColorVisuals(joined, vertex_colors=colors_at(mesh, np.asarray(joined.vertices)))
    return joined
