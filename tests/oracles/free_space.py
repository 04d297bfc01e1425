"""The oracle of `free_space` and `seen_through` in numpy, one view at a time."""

from __future__ import annotations

import numpy as np

from room2dgs.depth.completion.free_space import DOUBT, FROM_M, UP_TO, FreeSpace, Rays


def cells_of_view_reference(
    view: Rays, corner: np.ndarray, cell: float, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """(X, Y, Z) bool: the cells that a view looks through, and those where its rays end."""
    met, passed = np.zeros(shape, bool), np.zeros(shape, bool)
    met[_inside((view.ends - corner) / cell, shape)] = True
    start, reach = (view.centre - corner) / cell, (view.ends - view.centre) / cell
    length = np.linalg.norm(reach, axis=1)
    reach = reach[length > 0] / length[length > 0, None]
    length = UP_TO * length[length > 0]
    for step in FROM_M / cell + np.arange(length.max(initial=0)):
        on = length > step
        reach, length = reach[on], length[on]
        passed[_inside(start + step * reach, shape)] = True
    return passed, met


def seen_through_reference(space: FreeSpace, xyz: np.ndarray) -> np.ndarray:
    """(N,) of (N, 3) points."""
    place = np.floor((xyz - space.corner) / space.cell)
    inside = ((place >= 0) & (place < space.through.shape)).all(axis=-1)
    at = tuple(np.where(inside[:, None], place, 0).astype(np.int64).T)
    ended = np.where(inside, space.ended[at], 0)
    against = np.maximum(np.where(inside, space.through[at], 0) - ended, 0.0)
    return against / (against + DOUBT + ended)


def _inside(place: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, ...]:
    """Indices of places in cells; those outside are left out."""
    inside = ((place >= 0) & (place < shape)).all(axis=1)
    return tuple(place[inside].astype(np.int64).T)
