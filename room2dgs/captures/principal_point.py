"""Checks a principal point against the size of the photos."""

from __future__ import annotations

import numpy as np

from room2dgs.captures.lens import Lens
from room2dgs.errors import InputError

# Of width and height: a whole photo's principal point lies nearer to the middle than that. A cropped photo's may lie
# anywhere, and the intrinsics of another size have theirs off by one factor along both sides.
USUAL_OFF_CENTRE = 0.15
IMPOSSIBLE = 1.0  # a half of the size beyond the edge
SAME_FACTOR = 0.15  # relative difference of the factors along both sides


def check_principal_point(lens: Lens, sure: bool = False) -> str | None:
    """A warning, where the principal point is one of a cropped photo; None: it lies where most do.

    Args:
        lens: at the size of the photos.
        sure: somebody says that these intrinsics are for photos of this size: only what cannot be is refused.

    Raises:
        InputError: the principal point is far outside of the photos; or the intrinsics look like those of photos of
            another size, or of turned ones, and nobody is `sure`.
    """
    K, size = lens.K, lens.known_size
    at = K[:2, 2] / np.array(size)
    off = np.abs(at - 0.5)
    if (off <= USUAL_OFF_CENTRE).all():
        return None
    other = _of_this_size(K, size)
    where = f"{lens.source} has its principal point at ({K[0, 2]:g}, {K[1, 2]:g})"
    if not (off <= IMPOSSIBLE).all() or (other is not None and not sure):
        mend = other or "give the intrinsics of this image size"
        raise InputError(f"{where}, which does not fit the photos of {size[0]}x{size[1]} pixels; {mend}")
    else_ = other or "give the intrinsics of this image size as scene.intrinsics=[fx,fy,cx,cy]"
    return f"{where} of {size[0]}x{size[1]}: that is right if the photos are cropped, else {else_}"


def _of_this_size(K: np.ndarray, size: tuple[int, int]) -> str | None:
    """What mends intrinsics that have the mark of photos of another size; None: they have it not."""
    width, height = size
    x, y = 2.0 * K[:2, 2] / np.array(size)
    if not np.isfinite([x, y]).all() or min(x, y) <= 0:
        return None
    off = np.abs(np.array([x, y]) / 2 - 0.5)
    if abs(x / y - 1.0) < SAME_FACTOR and off.min() > USUAL_OFF_CENTRE / 2:
        both = np.sqrt(x * y)  # photos are resized by one factor, and a principal point lies near the middle alone
        values = ",".join(f"{value / both:.6g}" for value in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
        return f"they look like those of {width * x:.0f}x{height * y:.0f} pixels: give scene.intrinsics=[{values}]"
    turned = np.abs([2 * K[0, 2] / height - 1.0, 2 * K[1, 2] / width - 1.0])
    if turned.max() < SAME_FACTOR and abs(width / height - 1.0) > SAME_FACTOR:
        return f"they look like those of photos of {height}x{width} pixels: turn the photos, or give their intrinsics"
    return None
