"""Flip augmentation at test time: the predictions of a photo and of its mirror image, averaged."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from room2dgs.geometry.camera import Camera


class Prediction(NamedTuple):
    """A network's map of one photo.

    Attributes:
        values: (h, w) float32 depth or (h, w, 3) float32 unit normals.
        valid: (h, w) bool.
        error: (h, w) float32, the network's expected error, of ln depth or in radians; None: it gives none.
    """

    values: np.ndarray
    valid: np.ndarray
    error: np.ndarray | None


def mirrored_camera(camera: Camera) -> Camera:
    """The camera that takes the mirrored photo; its pose has no meaning."""
    K = camera.K.copy()
    K[0, 2] = camera.width - K[0, 2]
    return replace(camera, K=K)


def mirrored_back(found: Prediction) -> Prediction:
    """A mirrored photo's map as one of the photo."""
    values = found.values[:, ::-1]
    if values.ndim == 3:
        values = values * np.array([-1.0, 1.0, 1.0], np.float32)
    return Prediction(values, found.valid[:, ::-1], None if found.error is None else found.error[:, ::-1])


def averaged(one: Prediction, other: Prediction) -> Prediction:
    """Two maps of the same photo as one.

    Depth is averaged as its logarithm (as it is where it is not positive: disparity may be anything), normals as
    vectors. The error is the mean of both and the distance of each from the average.
    """
    valid = one.valid & other.valid
    if one.values.ndim == 3:
        mean = 0.5 * (one.values + other.values)
        length = np.linalg.norm(mean, axis=-1)
        valid = valid & (length > 0.1)
        values = np.where(valid[..., None], mean / np.where(valid, length, 1.0)[..., None], 0.0)
        apart = np.arccos(length.clip(0.0, 1.0))  # half the angle between two unit vectors
    else:
        positive = valid & (one.values > 0) & (other.values > 0)
        first, second = (np.where(positive, part.values, 1.0) for part in (one, other))
        values = np.where(positive, np.sqrt(first) * np.sqrt(second), 0.5 * (one.values + other.values))
        apart = 0.5 * np.abs(np.log(first / second))
    error = None
    if one.error is not None and other.error is not None:
        error = (0.5 * (one.error + other.error) + apart).astype(np.float32)
    return Prediction(values.astype(np.float32), valid, error)
