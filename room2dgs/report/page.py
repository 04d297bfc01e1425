"""HTML pages that need no network: Jinja2 templates, pictures inside the page."""

from __future__ import annotations

import base64
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import cv2
import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from room2dgs.report.table import Table
from room2dgs.texts import shown

JPEG_QUALITY = 85


class Figure(NamedTuple):
    """A picture, (H, W, 3) RGB 0..1, and what it shows."""

    caption: str
    picture: np.ndarray


def page(template: str, **values: Any) -> str:
    """A template of the folder `templates`, filled in; text is escaped, control characters and line breaks too."""
    return _environment().get_template(template).render(**values)


@cache
def script(name: str) -> Markup:
    """A script of ours or three.js, as it stands: nothing of the user's is in it."""
    return Markup(files("room2dgs.report").joinpath("web", f"{name}.js").read_text(encoding="utf-8"))


def data_uri(picture: np.ndarray) -> str:
    """(H, W, 3) RGB 0..1 as a JPEG inside the page."""
    pixels = np.round(np.clip(picture.astype(np.float32), 0, 1) * 255).astype(np.uint8)
    encoded = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return "data:image/jpeg;base64," + base64.b64encode(encoded.tobytes()).decode("ascii")


def svg_uri(svg: str) -> str:
    """An SVG as a picture inside the page."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode("utf-8")).decode("ascii")


def drawn(figure: Any, dpi: int) -> np.ndarray:
    """(H, W, 3) RGB 0..1 of a matplotlib figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3] / 255.0


def in_drawing(text: str) -> str:
    """Text of anybody's for matplotlib, which takes what stands between two dollars for mathematics."""
    return shown(text).replace("$", "\\$")


@cache
def _environment() -> Environment:
    found = Environment(
        loader=PackageLoader("room2dgs.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=_shown,
    )
    found.filters["data_uri"] = data_uri
    found.filters["svg_uri"] = svg_uri
    found.filters["table"] = _html
    found.filters["lines"] = _lines
    return found


def _shown(value: Any) -> Any:
    return value if not isinstance(value, str) or isinstance(value, Markup) or value.isprintable() else shown(value)


def _lines(text: str) -> Markup:
    """Our own text of several lines."""
    return Markup("\n").join(map(shown, text.split("\n")))


def _html(table: Table) -> Markup:
    frame = table.frame.map(shown).rename(columns=shown)
    with pd.option_context("display.max_colwidth", None):  # else pandas cuts long cells
        return Markup(frame.to_html(index=False, border=0))  # pandas escapes the cells
