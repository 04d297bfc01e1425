"""A frame's priors as a view of any size compares them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping

import cv2
import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.packed_maps import Packed, digest, pack, unpack
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.captures.view_maps import ViewMaps, valid_depth, valid_normal
from room2dgs.losses.depth_prior import edge_band

EDGE_JUMP = 0.05  # of depth, from one pixel to the next
EDGE_BAND_PX = 3  # of the prior's own pixels, to each side of an edge
WHOLE = 1 - 1e-4  # share of a pixel that valid ones must cover; resizing rounds
# Every other row and column: a surfel covers many pixels, and terms and memory cost a quarter.
COMPARED_STEP = 2
COMPARED = (slice(None, None, COMPARED_STEP),) * 2


def prior_maps(prior: ViewMaps[np.ndarray], width: int, height: int) -> ViewMaps[np.ndarray]:
    """What losses compare of the priors at `width` x `height` pixels: the pixels `COMPARED`.

    A pixel is valid if all that it is made of is; depth's own edges are not. Inverse depth is what is averaged: it is
    linear in the image on every plane, so a plane stays that plane.

    Returns:
        Maps with their confidences, 0 = invalid; None where the frame has none.
    """
    depth, normal, depth_confidence, normal_confidence = None, None, None, None
    if prior.depth is not None:
        valid = valid_depth(prior.depth)
        inverse = np.divide(1, prior.depth, out=np.zeros(prior.depth.shape, np.float32), where=valid)
        valid &= ~edge_band(np.where(valid, prior.depth, 0), EDGE_JUMP, EDGE_BAND_PX)
        inverse, valid = (values[COMPARED] for values in _resized(inverse, valid, width, height))
        depth = np.divide(1, inverse, out=np.zeros_like(inverse), where=valid)
        depth_confidence = _confidence(prior.depth_confidence, valid, width, height)
    if prior.normal is not None:
        valid = valid_normal(prior.normal)
        normal = np.where(valid[:, :, None], prior.normal, 0).astype(np.float32)
        normal, valid = (values[COMPARED] for values in _resized(normal, valid, width, height))
        length = np.linalg.norm(normal, axis=2, keepdims=True)
        normal = np.where(valid[:, :, None], normal / np.maximum(length, 1e-6), np.float32(0))
        normal_confidence = _confidence(prior.normal_confidence, valid, width, height)
    return ViewMaps(depth, depth_confidence, normal, normal_confidence, prior.source)


def compared_maps(packed: Packed) -> ViewMaps[Tensor]:
    """What `prior_maps` gave, packed on the way, as tensors."""
    maps = unpack(packed)
    tensors = (None if values is None else torch.from_numpy(values) for values in maps[:4])
    depth, depth_confidence, normal, normal_confidence = tensors
    return ViewMaps(depth, depth_confidence, normal, normal_confidence)


def priors_digest(priors: Mapping[str, ViewMaps[np.ndarray]], names: Iterable[str]) -> str:
    """Sixteen hex digits that stand for the priors of these frames."""
    hasher = hashlib.sha256()
    for name in names:
        known = "none"
        if name in priors:
            known = priors.digest(name) if isinstance(priors, StoredMaps) else digest(pack(priors[name]))
        hasher.update(f"{name} {known}\n".encode())
    return hasher.hexdigest()[:16]


def _confidence(confidence: np.ndarray | None, valid: np.ndarray, width: int, height: int) -> np.ndarray:
    if confidence is None:
        return valid.astype(np.float32)
    confidence = np.ascontiguousarray(confidence, np.float32)
    resized = _resized(confidence, np.ones(confidence.shape, bool), width, height)[0]
    return np.where(valid, resized[COMPARED], np.float32(0))


def _resized(values: np.ndarray, valid: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    if valid.shape == (height, width):
        return values, valid
    smaller = width <= valid.shape[1] and height <= valid.shape[0]
    how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    share = cv2.resize(valid.astype(np.float32), (width, height), interpolation=how)
    return cv2.resize(values, (width, height), interpolation=how), share > WHOLE
