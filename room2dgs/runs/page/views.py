"""A page's photos beside what the run made of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.eval.image_metrics import psnr
from room2dgs.eval.shading import error_color
from room2dgs.report.page import data_uri
from room2dgs.runs.page.trust import picture as trust_picture
from room2dgs.runs.pictures import depth_picture, normal_picture
from room2dgs.runs.trust import Trust
from room2dgs.texts import shown

if TYPE_CHECKING:
    from room2dgs.splat.types import Rendering

KINDS = (
    ("rendering", "rendering"),
    ("difference", "difference"),
    ("depth", "depth"),
    ("normals", "normals"),
    ("trust", "where depth was trusted"),
)
LONGEST = 480  # pixels of a picture
FULL = 0.25  # of the brightest: a difference from here on is red
Rendered = Callable[[Iterable[Frame]], Iterator[tuple[Frame, "Rendering"]]]


def view_pictures(scene: Scene, rendered: Rendered, trust: Mapping[str, Trust], most: int) -> list[dict[str, Any]]:
    """Held-out views, then training views, for wipe.js.

    Args:
        rendered: renders frames, one at a time.
        trust: training view -> its maps.
        most: views of each sort.
    """
    mapped = [frame for frame in scene.train if frame.name in trust]
    parts = (("held out", evenly_spaced(scene.test, most)), ("training", evenly_spaced(mapped or scene.train, most)))
    return [
        _view(frame, view, sort, trust.get(frame.name)) for sort, frames in parts for frame, view in rendered(frames)
    ]


def _view(frame: Frame, view: Rendering, sort: str, trusted: Trust | None) -> dict[str, Any]:
    photo, color = frame.color(), frame.exposed(view.color.clamp(0, 1).numpy())
    covered = view.covered.numpy()
    difference = np.abs(photo.astype(np.float32) / 255 - color).mean(axis=-1)
    pictures = {
        "photo": photo / 255,
        "rendering": color,
        "difference": error_color(difference.ravel(), FULL).reshape(color.shape),
        "depth": depth_picture(view.median_depth.numpy(), covered) / 255,
        "normals": normal_picture(view.normal.numpy(), frame.camera, covered) / 255,
    }
    if trusted is not None:
        pictures["trust"] = cv2.resize(trust_picture(trusted), frame.camera.size, interpolation=cv2.INTER_NEAREST) / 255
    quality = psnr(color, photo, frame.mask())
    return {
        "title": f"{shown(frame.name)} ({sort})",
        "note": f"{shown(frame.name)}, {sort}: the rendering has a PSNR of {quality:.1f} dB against the photo.",
        "pictures": {kind: data_uri(small(picture, LONGEST)) for kind, picture in pictures.items()},
    }


def small(picture: np.ndarray, longest: int) -> np.ndarray:
    """The picture, (H, W, 3) RGB, with no side longer than so many pixels."""
    height, width = picture.shape[:2]
    scale = longest / max(height, width)
    if scale >= 1:
        return picture
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
