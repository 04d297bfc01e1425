"""A frame's priors as a view of any size compares them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor

from room2dgs.losses.depth_prior import edge_band

if TYPE_CHECKING:
    from room2dgs.priors.prior import Prior

EDGE_JUMP = 0.05  # of depth, from one pixel to the next
EDGE_BAND_PX = 3  # of the prior's own pixels, to each side of an edge
WHOLE = 1 - 1e-4  # share of a pixel that valid ones must cover; resizing rounds


class PriorMaps(NamedTuple):
    """Maps at a view's size; None where the frame has none.

    Attributes:
        depth: (H, W) float32, metres; depth_valid: (H, W) bool, without the depth's edges.
        normal: (H, W, 3) float32 unit, world frame, facing the camera; normal_valid: (H, W) bool.
        depth_weight, normal_weight: (H, W) float32 in 0..1; None also where the prior has none: 1 everywhere.
    """

    depth: Tensor | None = None
    depth_valid: Tensor | None = None
    normal: Tensor | None = None
    normal_valid: Tensor | None = None
    depth_weight: Tensor | None = None
    normal_weight: Tensor | None = None


def prior_maps(prior: Prior | None, width: int, height: int) -> PriorMaps:
    """The priors at `width` x `height` pixels; a pixel is valid if all that it is made of is.

    Inverse depth is what is averaged: it is linear in the image on every plane, so a plane stays that plane.
    """
    if prior is None:
        return PriorMaps()
    maps = PriorMaps()
    if prior.depth is not None:
        valid = np.isfinite(prior.depth) & (prior.depth > 0)
        if prior.depth_valid is not None:
            valid &= prior.depth_valid
        inverse = np.divide(1, prior.depth, out=np.zeros(prior.depth.shape, np.float32), where=valid)
        valid &= ~edge_band(np.where(valid, prior.depth, 0), EDGE_JUMP, EDGE_BAND_PX)
        inverse, valid = _resized(inverse, valid, width, height)
        depth = np.divide(1, inverse, out=np.zeros_like(inverse), where=valid)
        maps = maps._replace(depth=torch.from_numpy(depth), depth_valid=torch.from_numpy(valid))
        maps = maps._replace(depth_weight=_weight(prior.depth_weight, width, height))
    if prior.normal is not None:
        valid = np.isfinite(prior.normal).all(2) & (np.abs(prior.normal).max(2) > 0)
        if prior.normal_valid is not None:
            valid &= prior.normal_valid
        normal, valid = _resized(np.where(valid[:, :, None], prior.normal, 0).astype(np.float32), valid, width, height)
        normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-6)
        maps = maps._replace(normal=torch.from_numpy(normal), normal_valid=torch.from_numpy(valid))
        maps = maps._replace(normal_weight=_weight(prior.normal_weight, width, height))
    return maps


def priors_digest(priors: Mapping[str, Prior], names: Iterable[str]) -> str:
    """Sixteen hex digits that stand for the priors of these frames."""
    hasher = hashlib.sha256()
    for name in names:
        hasher.update(name.encode())
        for values in priors.get(name) or ():
            known = None if values is None else np.ascontiguousarray(values)
            hasher.update(b"none" if known is None else f"{known.dtype} {known.shape}".encode())
            hasher.update(b"" if known is None else known.data)
    return hasher.hexdigest()[:16]


def _weight(weight: np.ndarray | None, width: int, height: int) -> Tensor | None:
    if weight is None:
        return None
    weight = np.ascontiguousarray(weight, np.float32)
    return torch.from_numpy(_resized(weight, np.ones(weight.shape, bool), width, height)[0])


def _resized(values: np.ndarray, valid: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    if valid.shape == (height, width):
        return values, valid
    smaller = width <= valid.shape[1] and height <= valid.shape[0]
    how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    share = cv2.resize(valid.astype(np.float32), (width, height), interpolation=how)
    return cv2.resize(values, (width, height), interpolation=how), share > WHOLE
