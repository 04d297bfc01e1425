"""Completed depth at its photo's size, with the fine detail that stereo has."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.uncertainty import completed_weight
from room2dgs.depth.completion.expected_error import LEAST_ERROR
from room2dgs.depth.completion.low_res import Completed, enlarged
from room2dgs.depth.files import resize_depth
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.passes import StereoMap

FINE = 4.0  # sigmas by which stereo's own pixel differs if half of the difference counts as noise
LEAST_CONSISTENT = 3  # consistent views with which a pixel of stereo stands in its own right
NEAR = 0.03  # relative difference up to which it is the same surface


class Restored(NamedTuple):
    """One view's depth at its photo's size.

    Attributes:
        median_sigma: of the low-resolution depth; NaN where there is none.
        depth: (H, W) float32 metres, 0 = invalid.
        weight: (H, W) float32, 0..1.
    """

    median_sigma: float
    depth: np.ndarray
    weight: np.ndarray


def restored(
    depth: np.ndarray, view: Completed, sigma: np.ndarray, stereo: StereoMap | None, camera: Camera
) -> Restored:
    """The completed log-scale, enlarged and applied to the whole depth map.

    Args:
        depth: (H, W) metres, before completion.
        view: what has come of it at low resolution.
        sigma: (h, w) relative standard deviation expected of that.
        stereo: the view's own, of any size.
        camera: of the photo.
    """
    known = view.depth > 0
    median = float(np.median(sigma[known])) if known.any() else float("nan")
    large = partial(cv2.resize, dsize=depth.shape[::-1], interpolation=cv2.INTER_LINEAR)
    weight = large(completed_weight(sigma))
    full = (depth * np.exp(enlarged(view.log_scale, known, depth.shape))).astype(np.float32)
    if stereo is not None:
        full = with_stereo_detail(full, large(sigma.astype(np.float32)), stereo, camera)
    return Restored(median, full, np.where(full > 0, weight, 0).astype(np.float32))


def with_stereo_detail(depth: np.ndarray, sigma: np.ndarray, stereo: StereoMap, camera: Camera) -> np.ndarray:
    """Stereo's own pixels where they hardly differ, for how sure depth is: they have the fine detail. What differs by
    more is noise, or what completion has mended.

    Args:
        depth, sigma: (H, W), of the photo's size.
    """
    kept = np.where(stereo.num_consistent >= LEAST_CONSISTENT, stereo.depth, 0)
    fine, there = resize_depth(kept, kept > 0, camera)
    there &= np.abs(fine - depth) < NEAR * depth
    detail = np.log(np.where(there, fine, 1) / np.where(there, depth, 1))
    noise = FINE * np.maximum(sigma, LEAST_ERROR)
    return (depth * np.exp(detail / (1 + (detail / noise) ** 2))).astype(np.float32)
