"""PSNR and SSIM of rendered against real views."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

SMALLEST_MSE = 1e-10  # equal images score 100 dB, not infinity
SCORES = ("psnr_db", "psnr_fitted_db", "ssim")
LEAST_PIXELS = 64  # that a colour map is fitted to
LEAST_SPREAD = 1e-6  # of colours; what varies less says nothing of the map, which stays the identity there


def image_scores(pairs: Iterable[tuple]) -> dict[str, Any]:
    """Means over views, and each view's own.

    Args:
        pairs: (name, rendering, photo), each (H, W, 3), uint8 0..255 or float 0..1 (clipped to it);
            taken one at a time; a fourth is a mask (H, W) bool of the pixels that count, None: all.

    Returns:
        {"psnr_db", "psnr_fitted_db", "ssim": means, None without views; "views": {name: the same of each}}.
        "psnr_fitted_db" is after `color_fitted`.

    Raises:
        ValueError: a pair's shapes differ.
    """
    views = {}
    for name, rendering, photo, *rest in pairs:
        mask = rest[0] if rest else None
        if rendering.shape != photo.shape:
            raise ValueError(f"view {name}: rendering {rendering.shape} and photo {photo.shape} differ in shape")
        views[name] = {
            "psnr_db": psnr(rendering, photo, mask),
            "psnr_fitted_db": psnr(color_fitted(rendering, photo, mask), photo, mask),
            "ssim": ssim(rendering, photo, mask),
        }
    means = {key: float(np.mean([view[key] for view in views.values()])) if views else None for key in SCORES}
    return {**means, "views": views}


def color_fitted(rendering: np.ndarray, photo: np.ndarray, mask: np.ndarray | None = None) -> np.ndarray:
    """(H, W, 3) float64 0..1: the rendering's colours by the affine map that brings them nearest to the photo's.

    What is left is not the exposure's or the white balance's fault, which a held-out photo has of its own. Least
    squares over the pixels (of a mask) that the photo does not clip; the identity where there are too few.
    """
    color, target = _unit(rendering), _unit(photo)
    fit = ((target > 0) & (target < 1)).all(axis=-1)
    if mask is not None:
        fit &= mask
    if fit.sum() < LEAST_PIXELS:
        return color
    middle = color[fit].mean(axis=0), target[fit].mean(axis=0)
    a, b = color[fit] - middle[0], target[fit] - middle[1]
    # sums by einsum: those of a threaded library may follow the threads
    spread, both = np.einsum("ni,nj->ij", a, a) / len(a), np.einsum("ni,nj->ij", a, b) / len(a)
    matrix = np.eye(3) + np.linalg.solve(spread + LEAST_SPREAD * np.eye(3), both - spread)
    return np.clip((color - middle[0]) @ matrix + middle[1], 0, 1)


def psnr(rendering: np.ndarray, photo: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Peak signal-to-noise ratio in dB, peak 1, over all pixels (or those of a mask) and channels; at most 100."""
    squares = (_unit(rendering) - _unit(photo)) ** 2
    error = float(np.mean(squares if mask is None or not mask.any() else squares[mask]))
    return float(-10 * np.log10(max(error, SMALLEST_MSE)))


def ssim(rendering: np.ndarray, photo: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean structural similarity over channels and the pixels whose whole window lies in the image (and a mask)."""
    import cv2
    import torch

    from room2dgs.geometry import similarity

    a, b = (torch.from_numpy(_unit(image)) for image in (rendering, photo))
    values = similarity.ssim(a, b, border="inside")
    if mask is not None:
        reach, window = similarity.WINDOW // 2, np.ones((similarity.WINDOW,) * 2, np.uint8)
        whole = cv2.erode(mask.astype(np.uint8), window)[reach:-reach, reach:-reach] > 0
        if whole.any():
            values = values[torch.from_numpy(whole)]
    return float(values.mean())


def _unit(image: np.ndarray) -> np.ndarray:
    if image.dtype == np.uint8:
        return image.astype(np.float64) / 255
    return np.clip(image.astype(np.float64), 0, 1)
