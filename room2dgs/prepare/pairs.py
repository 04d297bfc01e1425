"""Which photos to match with which when no pose is known."""

from __future__ import annotations

import numpy as np


def sequential_pairs(count: int, overlap: int) -> list[tuple[int, int]]:
    """Each photo with the `overlap` that follow it, and with those 2, 4, 8, ... times as far ahead."""
    steps = [*range(1, overlap + 1)]
    steps += [step for power in range(1, 5) if (step := overlap * 2**power) < count]
    return [(i, i + step) for i in range(count) for step in steps if i + step < count]


def all_pairs(count: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(count) for j in range(i + 1, count)]


def loop_pairs(similarity: np.ndarray, most: int, apart: int) -> list[tuple[int, int]]:
    """Each photo with those that look most like it among those that are at least so far from it in the sequence.

    Args:
        similarity: (N, N) symmetric.
        most: photos for each.
    """
    count = len(similarity)
    found: set[tuple[int, int]] = set()
    place = np.arange(count)
    for i in range(count):
        others = place[np.abs(place - i) > apart]
        order = others[np.argsort(-similarity[i, others], kind="stable")][:most]
        found.update((min(i, int(j)), max(i, int(j))) for j in order)
    return sorted(found)
