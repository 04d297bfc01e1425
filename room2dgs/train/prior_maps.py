"""A frame's priors as a view of any size compares them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping

import cv2
import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.view_maps import ViewMaps, valid_depth, valid_normal
from room2dgs.losses.depth_prior import edge_band

EDGE_JUMP = 0.05  # of depth, from one pixel to the next
EDGE_BAND_PX = 3  # of the prior's own pixels, to each side of an edge
WHOLE = 1 - 1e-4  # share of a pixel that valid ones must cover; resizing rounds


def prior_maps(prior: ViewMaps[np.ndarray] | None, width: int, height: int) -> ViewMaps[Tensor]:
    """The priors at `width` x `height` pixels; a pixel is valid if all that it is made of is.

    Depth's own edges are taken out. Inverse depth is what is averaged: it is linear in the image on every plane, so a
    plane stays that plane.

    Returns:
        Maps with their confidences, 0 = invalid; None where the frame has none.
    """
    if prior is None:
        return ViewMaps()
    maps = ViewMaps(source=prior.source)
    if prior.depth is not None:
        valid = valid_depth(prior.depth)
        inverse = np.divide(1, prior.depth, out=np.zeros(prior.depth.shape, np.float32), where=valid)
        valid &= ~edge_band(np.where(valid, prior.depth, 0), EDGE_JUMP, EDGE_BAND_PX)
        inverse, whole = _resized(inverse, valid, width, height)
        depth = np.divide(1, inverse, out=np.zeros_like(inverse), where=whole)
        confidence = _confidence(prior.depth_confidence, whole, width, height)
        maps = maps._replace(depth=torch.from_numpy(depth), depth_confidence=confidence)
    if prior.normal is not None:
        valid = valid_normal(prior.normal)
        normal = np.where(valid[:, :, None], prior.normal, 0).astype(np.float32)
        normal, whole = _resized(normal, valid, width, height)
        length = np.linalg.norm(normal, axis=2, keepdims=True)
        normal = np.where(whole[:, :, None], normal / np.maximum(length, 1e-6), np.float32(0))
        confidence = _confidence(prior.normal_confidence, whole, width, height)
        maps = maps._replace(normal=torch.from_numpy(normal), normal_confidence=confidence)
    return maps


def priors_digest(priors: Mapping[str, ViewMaps[np.ndarray]], names: Iterable[str]) -> str:
    """Sixteen hex digits that stand for the priors of these frames."""
    hasher = hashlib.sha256()
    for name in names:
        hasher.update(name.encode())
        for values in priors.get(name, ViewMaps())[:4]:
            known = None if values is None else np.ascontiguousarray(values)
            hasher.update(b"none" if known is None else f"{known.dtype} {known.shape}".encode())
            hasher.update(b"" if known is None else known.data)
    return hasher.hexdigest()[:16]


def _confidence(confidence: np.ndarray | None, valid: np.ndarray, width: int, height: int) -> Tensor:
    if confidence is None:
        return torch.from_numpy(valid.astype(np.float32))
    confidence = np.ascontiguousarray(confidence, np.float32)
    resized = _resized(confidence, np.ones(confidence.shape, bool), width, height)[0]
    return torch.from_numpy(np.where(valid, resized, np.float32(0)))


def _resized(values: np.ndarray, valid: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    if valid.shape == (height, width):
        return values, valid
    smaller = width <= valid.shape[1] and height <= valid.shape[0]
    how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    share = cv2.resize(valid.astype(np.float32), (width, height), interpolation=how)
    return cv2.resize(values, (width, height), interpolation=how), share > WHOLE
