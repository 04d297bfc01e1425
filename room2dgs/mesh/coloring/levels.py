"""How bright and how sharp each photo is beside the others: what several see should look the same in all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.exposure.gains import means, solved
from room2dgs.mesh.coloring.best import Levels, Points, Views
from room2dgs.mesh.coloring.drawn import Surface

SAMPLE = 8_000  # points at which photos are compared
LEVELS_PX = 240  # width at which they are
DARK, BRIGHT = 8, 247  # levels between which exposure shows
DOUBT = 0.1  # log of a ratio, at which an observation counts half
ROUNDS = 8
PRIOR = 20.0  # observations that say that a photo is like the others
CONTRAST = 8.0  # levels of the contrast's picture, of one of the photo's second difference
LEAST_SHARP = 0.2


def levels_of(points: Points, surface: Surface, frames: Sequence[Frame]) -> Levels:
    """Gains and sharpness of photos, at a sample of the points.

    The logarithms are a sum of what the photo adds and what the point has: least squares with doubts (Cauchy), points
    eliminated.
    """
    count = len(points.places)
    some = np.sort(np.random.default_rng(0).permutation(count)[:SAMPLE])
    sample = Points(points.places[some], points.normals[some], np.zeros(len(some), np.float32))
    parts = [_observed(sample, surface, frame) for frame in frames]
    view = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    point = np.concatenate([part[0] for part in parts]) if parts else np.zeros(0, int)
    color = np.concatenate([part[1] for part in parts]) if parts else np.zeros((0, 3))
    contrast = np.concatenate([part[2] for part in parts]) if parts else np.zeros(0)
    shape = (len(frames), len(some))
    fit = ((color > DARK) & (color < BRIGHT)).all(axis=1)
    logs = np.log(np.maximum(color[fit], 1.0))
    gain = np.stack([view_offsets(view[fit], point[fit], one, shape, DOUBT) for one in logs.T], axis=1)
    clear = contrast > 2  # of what has some
    blur = view_offsets(view[clear], point[clear], np.log(contrast[clear]), shape, 3 * DOUBT)
    usual = np.median(blur) if len(blur) else 0.0
    return Levels(np.exp(gain).astype(np.float32), np.exp(blur - usual).clip(LEAST_SHARP, 1.0))


def view_offsets(
    view: np.ndarray, point: np.ndarray, values: np.ndarray, shape: tuple[int, int], doubt: float
) -> np.ndarray:
    """(V,) what each view adds to the values (N,) of the points that it sees; their mean is 0.

    Args:
        view, point: (N,) int, of each observation.
        shape: how many views and points there are.
        doubt: a residual at which an observation counts half.
    """
    found, weight = np.zeros(shape[0]), np.ones(len(values))
    for _ in range(ROUNDS if len(values) else 0):
        found = solved(found, view, point, values, weight, shape, PRIOR)
        own = means(point, values - found[view], weight, shape[1])
        weight = 1 / (1 + ((values - found[view] - own[point]) / doubt) ** 2)
    return found


def _observed(points: Points, surface: Surface, frame: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points that a photo sees: (N,) index, (N, 3) colour, (N,) contrast around them."""
    photo = frame.color()
    small = replace(frame, camera=frame.camera.resized_to_width(min(LEVELS_PX, frame.camera.width)), cache=None)
    size = small.camera.size
    edges = cv2.convertScaleAbs(cv2.Laplacian(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), cv2.CV_16S), alpha=CONTRAST)
    contrast = cv2.resize(cv2.blur(edges, (9, 9)), size, interpolation=cv2.INTER_AREA)
    views = Views(points)
    color = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    # the kernel reads two pictures of a view: here colour and contrast
    views.look(small, surface.seen_by(small.camera).depth, color, np.stack([contrast] * 3, axis=-1), np.ones(3))
    seen = np.flatnonzero(views.quality[:, 0] > 0)
    return seen, views.sharp[seen, 0].astype(np.float64), views.low[seen, 0, 0].astype(np.float64)
