"""The cameras' path from above, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from room2dgs.files import whole_file

SIDE, MARGIN = 900, 60
VIEW_PX = 32  # of the line that shows where a camera looks
INSIDE = (0.02, 0.98)  # quantiles of the points that the picture shows


def draw_path(
    path: Path, xyz: np.ndarray, centres: np.ndarray, forwards: np.ndarray, weak: Sequence[bool], metric: bool
) -> None:
    """Points in grey, cameras in order from blue to yellow with their view, those with few points as crosses.

    Args:
        xyz: (P, 3) points; z up.
        centres, forwards: (N, 3) of the cameras, in order.
        weak: (N,).
        metric: whether a bar of 1 m means something.
    """
    low, high = np.quantile(xyz[:, :2] if len(xyz) else centres[:, :2], INSIDE, axis=0)
    low, high = np.minimum(low, centres[:, :2].min(0)), np.maximum(high, centres[:, :2].max(0))
    scale = (SIDE - 2 * MARGIN) / max(float((high - low).max()), 1e-9)

    def pixel(points: np.ndarray) -> np.ndarray:
        place = (points[:, :2] - low) * scale + MARGIN
        place[:, 1] = SIDE - place[:, 1]
        return place.round().astype(int)

    picture = np.repeat(_shade(pixel(xyz))[..., None], 3, axis=2)
    length = VIEW_PX / scale
    ends = pixel(centres + length * forwards)
    places = pixel(centres)
    colors = cv2.applyColorMap(np.linspace(20, 235, len(places)).astype(np.uint8)[None], cv2.COLORMAP_PLASMA)[0]
    for index in range(1, len(places)):
        cv2.line(picture, places[index - 1], places[index], colors[index].tolist(), 1, cv2.LINE_AA)
    for place, end, color, is_weak in zip(places, ends, colors, weak, strict=True):
        cv2.line(picture, place, end, color.tolist(), 1, cv2.LINE_AA)
        if is_weak:
            cv2.drawMarker(picture, place, (0, 0, 255), cv2.MARKER_TILTED_CROSS, 14, 2, cv2.LINE_AA)
        else:
            cv2.circle(picture, place, 4, color.tolist(), -1, cv2.LINE_AA)
    text = f"{len(places)} cameras from above, dark blue first, yellow last; red: few points"
    cv2.putText(picture, text, (12, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    if metric and scale < SIDE:
        y = SIDE - 24
        cv2.line(picture, (MARGIN, y), (MARGIN + round(scale), y), (0, 0, 0), 2)
        cv2.putText(picture, "1 m", (MARGIN, y - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    with whole_file(path) as temporary:
        temporary.write_bytes(cv2.imencode(".png", picture)[1].tobytes())


def _shade(places: np.ndarray) -> np.ndarray:
    """(SIDE, SIDE) uint8: white, the darker the more points lie there."""
    places = places[((places >= 0) & (places < SIDE)).all(axis=1)]
    dark: np.ndarray = np.zeros((SIDE, SIDE), np.float32)
    np.add.at(dark, (places[:, 1], places[:, 0]), 1.0)
    dark = cv2.GaussianBlur(dark, (0, 0), 1.0)
    most = float(np.quantile(dark[dark > 0], 0.95)) if len(places) else 1.0
    return (255 - 150 * np.minimum(1, dark / most)).astype(np.uint8)
