"""Colours of vertices that no photo sees, from those around them."""

from __future__ import annotations

import numpy as np

SWEEPS = 20


def spread_colors(colors: np.ndarray, known: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The colours with those of unknown vertices diffused from their neighbours.

    Ring by ring a vertex takes the mean of the neighbours that have a colour by then; then all that were unknown take
    their neighbours' mean, `SWEEPS` times. A piece of which nothing is known keeps its colours.

    Args:
        colors: (V, C).
        known: (V,) bool.
        faces: (F, 3).

    Returns:
        (V, C) float64.
    """
    result = np.array(colors, dtype=np.float64)
    to, of = _edges_into(~known, faces)
    have = known.copy()
    while True:
        ready = have[of] & ~have[to]
        if not ready.any():
            break
        _take_means(result, to[ready], of[ready])
        have[to[ready]] = True
    filled = have & ~known
    within = filled[to] & have[of]
    for _ in range(SWEEPS if within.any() else 0):
        _take_means(result, to[within], of[within])
    return result


def _edges_into(wanted: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(E,) vertices that are wanted, and (E,) a neighbour of each; edges between two faces come twice."""
    faces = faces[wanted[faces].any(axis=1)]
    to = np.concatenate([faces[:, i] for i in (0, 1, 2, 1, 2, 0)])
    of = np.concatenate([faces[:, i] for i in (1, 2, 0, 0, 1, 2)])
    return to[wanted[to]], of[wanted[to]]


def _take_means(values: np.ndarray, to: np.ndarray, of: np.ndarray) -> None:
    """Writes to each vertex of `to` the mean of its neighbours `of`, all at once."""
    places, index = np.unique(to, return_inverse=True)
    count = np.bincount(index)
    sums = [np.bincount(index, values[of, channel]) / count for channel in range(values.shape[1])]
    values[places] = np.stack(sums, axis=1)
