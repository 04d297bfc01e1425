"""Where the text of a room stands in its plan, and how large: inside its walls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.plan.outline import Outline

LETTER = 0.62  # width of a letter over its height, at most, on average
LINE = 1.6  # from line to line, over the height of letters
MARGIN_M = 0.1  # between text and walls
SMALLEST_M = 0.02
STEPS = 24  # places that are tried, across each way


class Label(NamedTuple):
    """Lines of text, each about its middle.

    Attributes:
        lines: (2,) the middle of each, level frame.
        size_m: height of the letters.
    """

    lines: tuple[np.ndarray, ...]
    size_m: float


def room_label(room: Outline, lines: Sequence[str], size_m: float) -> Label:
    """Lines in the room's widest place: at `size_m` as near to the middle as they fit there, or else smaller."""
    import shapely

    shape = shapely.Polygon(
        [side.start for side in room.sides], [[side.start for side in ring] for ring in room.islands]
    ).buffer(0)
    low, high = np.array(shape.bounds[:2]), np.array(shape.bounds[2:])
    middle = (low + high) / 2
    grid = np.stack(np.meshgrid(*np.linspace(low, high, STEPS + 2)[1:-1].T), axis=-1).reshape(-1, 2)
    places = np.concatenate([middle[None], grid])
    order = np.argsort(np.linalg.norm(places - middle, axis=1), kind="stable")
    half = np.array([LETTER * max(map(len, lines)), LINE * len(lines)]) / 2
    size = size_m
    while size > SMALLEST_M:
        reach = half * size + MARGIN_M * size / size_m
        for at in places[order]:
            if shape.contains(shapely.box(*(at - reach), *(at + reach))):
                return _label(at, len(lines), size)
        size *= 0.8
    return _label(np.array(shape.representative_point().coords[0]), len(lines), SMALLEST_M)


def _label(middle: np.ndarray, count: int, size_m: float) -> Label:
    below = np.array([0.0, -LINE * size_m])
    return Label(tuple(middle + (index - (count - 1) / 2) * below for index in range(count)), size_m)
