"""What the colours of a page mean."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.eval.shading import error_color
from room2dgs.runs.page import trust
from room2dgs.runs.page.mesh_layer import SEEN
from room2dgs.runs.page.views import FULL

TICKS = 5


class Key(NamedTuple):
    """A key to the layer or kind of pictures of this name.

    Attributes:
        swatches: colour and words; no colour: words alone.
        ticks: words under a bar of colours, evenly spaced from its beginning to its end; empty: no bar.
        bar: CSS colours of the bar.
        what: what its numbers are.
    """

    name: str
    swatches: tuple[tuple[str, str], ...] = ()
    ticks: tuple[str, ...] = ()
    bar: tuple[str, ...] = ()
    what: str = ""


def layer_keys(threshold_m: float, full: float) -> list[Key]:
    """Of the room's layers.

    Args:
        threshold_m: at which the mesh is scored.
        full: in thresholds, the error from which on the colour stays.
    """
    end_cm = full * threshold_m * 100
    ticks = [f"{end_cm * step / (TICKS - 1):g}" for step in range(TICKS)]
    return [
        _bar("expected", [*ticks[:-1], f"{ticks[-1]} cm and more"], "expected error, one standard deviation"),
        _bar("error", [*ticks[:-1], f"{ticks[-1]} cm and more"], "off the truth"),
        Key("seen", tuple((_css(color), label) for _, color, label in SEEN)),
    ]


def kind_keys(source: str) -> list[Key]:
    """Of the pictures beside photos.

    Args:
        source: where depth comes from (`Priors.depth_source`).
    """
    percent = [f"{FULL * step / (TICKS - 1):.0%}" for step in range(TICKS)]
    return [
        _bar("difference", [*percent[:-1], f"{percent[-1]} and more"], "of full brightness"),
        Key("depth", (("", "Near red, far blue; black where nothing was reconstructed."),)),
        Key("normals", (("", "Red: to the right, green: up, blue: towards the camera."),)),
        Key("trust", tuple(trust.key(source))),
    ]


def _bar(name: str, ticks: list[str], what: str) -> Key:
    colors = error_color(np.linspace(0, 1, 9), 1.0)
    return Key(name, ticks=tuple(ticks), bar=tuple(_css(tuple(color)) for color in colors), what=what)


def _css(color: tuple[float, ...]) -> str:
    return f"rgb({', '.join(str(round(part * 255)) for part in color)})"
