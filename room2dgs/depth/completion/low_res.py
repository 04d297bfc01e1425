"""The low resolution at which depth is completed: what each view's depth is completed from, and what comes of it."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.captures.uncertainty import misfit_divisor
from room2dgs.depth.completion.photo_edges import ties_across_edges
from room2dgs.depth.completion.solve import normal_slopes, prior_slopes
from room2dgs.depth.files import resize_depth
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.low_res import low_res_width


class LowResInput(NamedTuple):
    """What one view's depth is completed from; float32, (h, w) unless said otherwise.

    Attributes:
        camera: of that size.
        photo: (h, w, 3) RGB 0..1.
        normal: (h, w, 3) unit, world frame; 0 = none.
        sample: metres, of the depth sample in each pixel; 0 = none.
        sample_weight: 0..1.
        prior: metres, the prior's depth after the joint optimisation; 0 = invalid.
        prior_weight: 0..1.
        slopes: along x and y, as `system` takes them.
        slope_weight: 0..1.
        edges: what the photo leaves of the ties along x and y (`ties_across_edges`).
    """

    camera: Camera
    photo: np.ndarray
    normal: np.ndarray
    sample: np.ndarray
    sample_weight: np.ndarray
    prior: np.ndarray
    prior_weight: np.ndarray
    slopes: tuple[np.ndarray, np.ndarray]
    slope_weight: np.ndarray
    edges: tuple[np.ndarray, np.ndarray]


class Completed(NamedTuple):
    """One view's completed depth.

    Attributes:
        camera: of its size.
        sample, sample_weight: (h, w) metres, 0 = none; and its weight, 0..1: what it was completed from.
        log_scale: (h, w) float32, ln of completed over prior depth.
        depth: (h, w) float32 metres, 0 = invalid.
        flat: (h, w) float32, share of the way that the depth was moved to one of the planes, 0..1.
    """

    camera: Camera
    sample: np.ndarray
    sample_weight: np.ndarray
    log_scale: np.ndarray
    depth: np.ndarray
    flat: np.ndarray


def rescaled(view: Completed, log_factor: np.ndarray) -> Completed:
    """With (h, w) `log_factor` added to ln depth."""
    log_factor = log_factor.astype(np.float32)
    return view._replace(log_scale=view.log_scale + log_factor, depth=view.depth * np.exp(log_factor))


def low_res_input(
    frame: Frame,
    depth: np.ndarray,
    depth_weight: np.ndarray | None,
    normal: np.ndarray | None,
    normal_weight: np.ndarray | None,
    points: PointCloud,
    misfit: float,
) -> LowResInput:
    """One view at low resolution.

    Args:
        depth: (H, W) metres, 0 = invalid.
        depth_weight: (H, W) 0..1; None: 1.
        normal: (H, W, 3) unit, world frame; None: nobody knows normals.
        normal_weight: likewise.
        points: sparse points and depth samples.
        misfit: median relative residual of the prior at the points before any optimisation.
    """
    camera = frame.camera.resized_to_width(low_res_width(frame.camera.width))
    sample, sample_weight = _samples(frame, points, camera)
    prior, _ = resize_depth(depth, depth > 0, camera)  # the nearest pixel's is half a pixel off, in all to one side
    weight = np.ones(prior.shape, np.float32) if depth_weight is None else _reduced(depth_weight, camera)
    weight = weight / misfit_divisor(misfit)
    slope_weight = np.ones(prior.shape)
    unit = np.zeros((*prior.shape, 3), np.float32)
    if normal is None:
        slopes = prior_slopes(prior)
    else:
        unit = _reduced(normal, camera)
        length = np.linalg.norm(unit, axis=-1, keepdims=True)
        unit = np.where(length > 0.5, unit / np.maximum(length, 1e-6), 0)
        in_cam = camera.turned_to_camera(unit)
        slopes = normal_slopes(in_cam, camera.rays(), (camera.K[0, 0], camera.K[1, 1]))
        slope_weight = slope_weight if normal_weight is None else _reduced(normal_weight, camera)
    photo = cv2.resize(frame.color(), camera.size, interpolation=cv2.INTER_AREA)
    edges = ties_across_edges(photo)
    return LowResInput(
        camera,
        photo=_single(photo / 255),
        normal=_single(unit),
        sample=_single(sample),
        sample_weight=_single(sample_weight),
        prior=_single(prior),
        prior_weight=_single(weight),
        slopes=_both_single(slopes),
        slope_weight=_single(slope_weight),
        edges=_both_single(edges),
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


def _both_single(values: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return _single(values[0]), _single(values[1])


def _samples(frame: Frame, points: PointCloud, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) depth of the point with most weight in each pixel, of several the nearest, and (h, w) its weight."""
    seen = seen_points(points, frame)
    weight = points.weight_of(seen.index)
    depth_at, weight_at = np.zeros((camera.height, camera.width)), np.zeros((camera.height, camera.width))
    column, row = np.floor(seen.pixel * (np.array(camera.size) / frame.camera.size)).astype(np.int64).T
    row, column = row.clip(0, camera.height - 1), column.clip(0, camera.width - 1)
    order = np.lexsort((-seen.depth, weight))  # the last one is kept
    depth_at[row[order], column[order]] = seen.depth[order]
    weight_at[row[order], column[order]] = weight[order]
    return depth_at, weight_at


def _reduced(values: np.ndarray, camera: Camera) -> np.ndarray:
    return cv2.resize(values, camera.size, interpolation=cv2.INTER_AREA)
