"""A mesh against the photos: how much of them it covers, and whether they agree when each is warped over it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.selection import evenly_spaced
from room2dgs.eval.coverage import covered, mean_share
from room2dgs.eval.sightlines import ray_depth, small_camera
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera

MAX_VIEWS, NEIGHBOURS = 20, 2
SAMPLE_STEP = 31  # every so many of a view's pixels tell what its neighbours see
MAX_CANDIDATES = 40  # views of the best baselines, of which the neighbours are chosen
SAME_SIDE_COS = 0.5  # of the angle between the directions in which two neighbours look
MIN_OVERLAP = 0.25  # of the first view's pixels that its neighbour sees
BASELINE = 0.15  # of the median depth, wanted: from nearby photos agree over any surface, from far away over none
OCCLUSION = 0.03  # relative difference of depth from which on a point counts as hidden
RADIUS = 3  # pixels of the window that is correlated
LEAST_CONTRAST = 4.0  # standard deviation of grey levels in the window: below, noise is compared
LEAST_PIXELS = 50  # of a pair that is to count


class SmallView(NamedTuple):
    """A view, its photo and what it sees of the mesh, small.

    Attributes:
        camera: of the small size.
        grey: (h, w) float32, 0..255.
        usable: (h, w) bool: pixels that the capture's mask leaves.
        depth: (h, w) z-depth of the mesh, metres; 0 where it has none.
    """

    camera: Camera
    grey: np.ndarray
    usable: np.ndarray
    depth: np.ndarray


def small_view(frame: Frame, surface: Surface) -> SmallView:
    """The view as `small_camera` has it.

    Raises:
        InputError: the photo cannot be decoded.
    """
    camera = small_camera(frame.camera)
    grey = cv2.cvtColor(frame.color(), cv2.COLOR_RGB2GRAY).astype(np.float32)
    mask = frame.mask()
    usable = np.ones(camera.size[::-1], bool)
    if mask is not None:
        usable = cv2.resize(mask.astype(np.uint8), camera.size, interpolation=cv2.INTER_NEAREST_EXACT) > 0
    small = cv2.resize(grey, camera.size, interpolation=cv2.INTER_AREA)
    return SmallView(camera, small, usable, ray_depth(surface, camera))


def photo_agreement(frames: Sequence[Frame], view: Callable[[int], SmallView]) -> float | None:
    """Median normalised cross-correlation, -1..1, of windows of photos with their neighbours over the mesh.

    None: no two views see the same textured part of the mesh from different places.

    Args:
        frames: training views.
        view: place in `frames` -> its small view.
    """
    found = []
    for index in evenly_spaced(range(len(frames)), MAX_VIEWS):
        for other in _neighbours(index, view(index), frames):
            scores = window_correlation(view(index), view(other))
            if len(scores) >= LEAST_PIXELS:
                found.append(scores)
    return float(np.median(np.concatenate(found))) if found else None


def mesh_coverage(frames: Sequence[Frame], view: Callable[[int], SmallView]) -> float | None:
    """Share of the views' usable pixels whose ray hits the mesh, each view with the same weight; None without pixels.

    Args:
        frames, view: as in `photo_agreement`.
    """
    some = [view(index) for index in evenly_spaced(range(len(frames)), MAX_VIEWS)]
    return mean_share((covered(one.depth), one.usable) for one in some)


def window_correlation(view: SmallView, other: SmallView) -> np.ndarray:
    """(N,) correlation of the windows of a view's pixels with the other photo, where both see the mesh and texture."""
    points = view.camera.unproject_map(view.depth)
    pixel, z = other.camera.project(points.reshape(-1, 3))
    shape = view.depth.shape
    columns, rows = ((pixel[:, axis] - 0.5).astype(np.float32).reshape(shape) for axis in (0, 1))
    z = z.astype(np.float32).reshape(shape)
    seen = cv2.remap(other.depth, columns, rows, cv2.INTER_NEAREST, borderValue=0)
    usable = cv2.remap(other.usable.astype(np.uint8), columns, rows, cv2.INTER_NEAREST, borderValue=0) > 0
    valid = (view.depth > 0) & view.usable & usable & (z > 0) & (seen > 0) & (np.abs(seen - z) < OCCLUSION * z)
    warped = cv2.remap(other.grey, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    size = (2 * RADIUS + 1,) * 2

    def mean(values: np.ndarray) -> np.ndarray:
        return cv2.boxFilter(values.astype(np.float64), -1, size, borderType=cv2.BORDER_CONSTANT)

    whole = mean(valid) > 1 - 1e-6
    a, b = view.grey.astype(np.float64), np.where(valid, warped, 0).astype(np.float64)
    variance_a, variance_b = mean(a * a) - mean(a) ** 2, mean(b * b) - mean(b) ** 2
    whole &= (variance_a > LEAST_CONTRAST**2) & (variance_b > LEAST_CONTRAST**2)
    covariance = mean(a * b) - mean(a) * mean(b)
    return covariance[whole] / np.sqrt(variance_a[whole] * variance_b[whole])


def _neighbours(index: int, view: SmallView, frames: Sequence[Frame]) -> list[int]:
    """The views that see enough of what this one sees, from places about as far away as tells a wrong depth."""
    known = view.depth > 0
    if not known.any():
        return []
    points = view.camera.unproject_map(view.depth)[known][::SAMPLE_STEP]
    depth_m = float(np.median(view.depth[known]))
    candidates = []
    for other, frame in enumerate(frames):
        baseline = float(np.linalg.norm(frame.camera.centre - view.camera.centre)) / depth_m
        if other != index and baseline > 0 and frame.camera.forward @ view.camera.forward > SAME_SIDE_COS:
            candidates.append((abs(np.log(baseline / BASELINE)), other))
    found = []
    for _, other in sorted(candidates)[:MAX_CANDIDATES]:
        if frames[other].camera.in_view(points).mean() >= MIN_OVERLAP:
            found.append(other)
        if len(found) == NEIGHBOURS:
            break
    return found
