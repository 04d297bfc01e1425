"""What a length is measured between: points, pixels of photos, planes by name or by a point on them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from room2dgs.errors import InputError

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
POINT = re.compile(rf"(?P<plane>plane@)?({NUMBER}),({NUMBER}),({NUMBER})")
PIXEL = re.compile(rf"(?P<plane>plane@)?(?P<photo>[^@]+):({NUMBER}),({NUMBER})")
NAME = re.compile(r"floor|ceiling|wall_\d+")
WANTED = (
    "X,Y,Z (metres, in the world of mesh.ply), PHOTO:COLUMN,ROW, plane@ before one of them, floor, ceiling or wall_N"
)


@dataclass(frozen=True)
class Target:
    """One end of a length.

    Attributes:
        point: (3,) metres, world; None: it is a pixel, or a plane's name.
        photo, pixel: a photo's name and (column, row) in it; "" and None otherwise.
        name: of a plane of the plan; "" otherwise.
        plane: the plane around the point or pixel is meant.
        text: as it was typed.
    """

    text: str
    point: np.ndarray | None = None
    photo: str = ""
    pixel: np.ndarray | None = None
    name: str = ""
    plane: bool = False


def target_of(text: str) -> Target:
    """From what was typed.

    Raises:
        InputError: it is none of them.
    """
    if NAME.fullmatch(text):
        return Target(text, name=text, plane=True)
    if found := POINT.fullmatch(text):
        return Target(text, point=_numbers(text, found.groups()[1:]), plane=bool(found["plane"]))
    if found := PIXEL.fullmatch(text):
        pixel = _numbers(text, found.groups()[2:])
        return Target(text, photo=found["photo"], pixel=pixel, plane=bool(found["plane"]))
    raise InputError(f"{text!r} is nothing to measure from; give {WANTED}")


def _numbers(text: str, parts: tuple[str, ...]) -> np.ndarray:
    values = [float(part) for part in parts]
    if not all(math.isfinite(value) and abs(value) < 1e9 for value in values):
        raise InputError(f"{text!r} has a number that no room has; give {WANTED}")
    return np.array(values)


def length_of(text: str, what: str) -> tuple[float, float | None]:
    """A known length and its deviation, of "2.04" or "2.04+-0.005", metres.

    Raises:
        InputError: it is no length.
    """
    value, sign, sigma = text.replace("±", "+-").partition("+-")
    try:
        found = float(value), float(sigma) if sign else None
    except ValueError:
        found = math.nan, None
    if not (math.isfinite(found[0]) and found[0] > 0 and (found[1] is None or 0 <= found[1] < found[0])):
        raise InputError(f"{what} {text!r} is no length in metres; give for example 2.04 or 2.04+-0.005")
    return found
