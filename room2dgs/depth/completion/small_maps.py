"""One view's small images: what its depth is completed from, and what comes of it."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.depth.completion.photo_edges import ties_across_edges
from room2dgs.depth.completion.solve import normal_slopes, prior_slopes
from room2dgs.depth.files import resize_depth
from room2dgs.geometry.camera import Camera

COLUMNS = 160  # of the small images that are solved
HALF_MISFIT = 0.1  # relative residual at the points, before any optimisation, that halves the weight of the maps


class Completed(NamedTuple):
    """One view's small images.

    Attributes:
        camera: of their size.
        anchor, trust: (h, w) metres, 0 = none; and the trust in it, 0..1.
        log_scale: (h, w) float32, ln of completed over joint depth.
        depth: (h, w) float32 metres, 0 = invalid.
        flat: (h, w) float32, share of the way that the depth was moved to one of the planes, 0..1.
    """

    camera: Camera
    anchor: np.ndarray
    trust: np.ndarray
    log_scale: np.ndarray
    depth: np.ndarray
    flat: np.ndarray


def moved(part: Completed, by: np.ndarray) -> Completed:
    """With (h, w) `by` added to ln depth."""
    by = by.astype(np.float32)
    return part._replace(log_scale=part.log_scale + by, depth=part.depth * np.exp(by))


class SmallMaps(NamedTuple):
    """What a `system` is made of, float32, and the camera of that size."""

    camera: Camera
    photo: np.ndarray  # (h, w, 3) RGB 0..1
    normal: np.ndarray  # (h, w, 3) unit, world frame; 0 = none
    anchor: np.ndarray  # from here on as `system` takes them
    trust: np.ndarray
    prior: np.ndarray
    prior_weight: np.ndarray
    slopes: tuple[np.ndarray, np.ndarray]
    tie: np.ndarray
    edges: tuple[np.ndarray, np.ndarray]


def small_maps(
    frame: Frame,
    depth: np.ndarray,
    sure: np.ndarray | None,
    normal: np.ndarray | None,
    normal_sure: np.ndarray | None,
    points: PointCloud,
    misfit: float,
) -> SmallMaps:
    camera = frame.camera.resized_to_width(min(COLUMNS, frame.camera.width))
    anchor, trust = _anchors(frame, points, camera)
    prior, _ = resize_depth(depth, depth > 0, camera)  # the nearest pixel's is half a pixel off, in all to one side
    weight = np.ones(prior.shape, np.float32) if sure is None else _small(sure, camera)
    weight = weight / np.float32(1 + (misfit / HALF_MISFIT) ** 4)
    tie = np.ones(prior.shape)
    unit = np.zeros((*prior.shape, 3), np.float32)
    if normal is None:
        slopes = prior_slopes(prior)
    else:
        unit = _small(normal, camera)
        length = np.linalg.norm(unit, axis=-1, keepdims=True)
        unit = np.where(length > 0.5, unit / np.maximum(length, 1e-6), 0)
        in_cam = camera.turned_to_camera(unit)
        slopes = normal_slopes(in_cam, camera.rays(), (camera.K[0, 0], camera.K[1, 1]))
        tie = tie if normal_sure is None else _small(normal_sure, camera)
    photo = cv2.resize(frame.color(), camera.size, interpolation=cv2.INTER_AREA)
    edges = ties_across_edges(photo)
    one, pair = _single, lambda parts: (_single(parts[0]), _single(parts[1]))
    return SmallMaps(
        camera, *map(one, (photo / 255, unit, anchor, trust, prior, weight)), pair(slopes), one(tie), pair(edges)
    )


def enlarged(values: np.ndarray, known: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(H, W) float32 map at a larger size, interpolated; what is not known is taken from the nearest pixel that is.

    Args:
        values: (h, w) float32.
        known: (h, w) bool.
        shape: (H, W).
    """
    if known.any() and not known.all():
        rows, columns = distance_transform_edt(~known, return_distances=False, return_indices=True)
        values = values[rows, columns]
    return cv2.resize(values, shape[::-1], interpolation=cv2.INTER_LINEAR)


def _single(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32)


def _anchors(frame: Frame, points: PointCloud, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) depth of the most trusted point in each pixel, of several the nearest, and (h, w) the trust."""
    seen = seen_points(points, frame)
    weight = points.weight_of(seen.index)
    anchor, trust = np.zeros((camera.height, camera.width)), np.zeros((camera.height, camera.width))
    column, row = np.floor(seen.pixel * (np.array(camera.size) / frame.camera.size)).astype(np.int64).T
    row, column = row.clip(0, camera.height - 1), column.clip(0, camera.width - 1)
    order = np.lexsort((-seen.depth, weight))  # the last one stays
    anchor[row[order], column[order]] = seen.depth[order]
    trust[row[order], column[order]] = weight[order]
    return anchor, trust


def _small(values: np.ndarray, camera: Camera) -> np.ndarray:
    return cv2.resize(values, camera.size, interpolation=cv2.INTER_AREA)
