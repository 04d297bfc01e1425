"""The cameras' path from above, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from room2dgs.files import whole_file

SIDE, MARGIN = 900, 60
INSIDE = (0.02, 0.98)  # quantiles of the points that the picture shows


def draw_path(
    path: Path, xyz: np.ndarray, centres: np.ndarray, forwards: np.ndarray, weak: Sequence[bool], metric: bool
) -> None:
    """Points in grey, cameras in order from blue to yellow with their view, those that hang on few points as crosses.

    Args:
        xyz: (P, 3) points; z up.
        centres, forwards: (N, 3) of the cameras, in order.
        weak: (N,).
        metric: whether a bar of 1 m means something.
    """
    low, high = np.quantile(xyz[:, :2], INSIDE, axis=0) if len(xyz) else centres[:, :2].min(0), centres[:, :2].max(0)
    if len(xyz):
        low, high = np.quantile(xyz[:, :2], INSIDE[0], axis=0), np.quantile(xyz[:, :2], INSIDE[1], axis=0)
    low, high = np.minimum(low, centres[:, :2].min(0)), np.maximum(high, centres[:, :2].max(0))
    scale = (SIDE - 2 * MARGIN) / max(float((high - low).max()), 1e-9)

    def pixel(points: np.ndarray) -> np.ndarray:
        place = (points[:, :2] - low) * scale + MARGIN
        place[:, 1] = SIDE - place[:, 1]
        return place.round().astype(int)

    picture = np.full((SIDE, SIDE, 3), 255, np.uint8)
    inside = pixel(xyz)
    inside = inside[((inside >= 0) & (inside < SIDE)).all(axis=1)]
    dark = np.zeros((SIDE, SIDE), np.float32)
    np.add.at(dark, (inside[:, 1], inside[:, 0]), 1.0)
    dark = cv2.GaussianBlur(dark, (0, 0), 1.0)
    picture[:] = (
        255 - 150 * np.minimum(1, dark / max(float(np.quantile(dark[dark > 0], 0.95)), 1e-6) if len(inside) else dark)
    )[..., None].astype(np.uint8)
    ends = pixel(centres + 0.35 * np.median(np.linalg.norm(xyz - centres.mean(0), axis=1)) * 0.3 * forwards)
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
