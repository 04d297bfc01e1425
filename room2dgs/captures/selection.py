"""Chooses the frames that are used, and those that are held out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Item = TypeVar("Item")


def evenly_spaced(items: Sequence[Item], count: int | None) -> list[Item]:
    """`count` of the items, first and last among them, as evenly spaced as whole steps allow.

    None, or more than there are, gives all.
    """
    if count is None or count >= len(items):
        return list(items)
    return [items[int(index)] for index in np.linspace(0, len(items) - 1, count).round()]


def hold_out(items: Sequence[Item], every: int) -> tuple[list[Item], list[Item]]:
    """Split into (training, held out): one of each group of `every` items is held out, none for 0.

    It is the group's middle one, so that a held-out view lies between training views.
    """
    held = set(range(every // 2, len(items), every)) if every else set()
    train = [item for index, item in enumerate(items) if index not in held]
    return train, [items[index] for index in sorted(held)]
