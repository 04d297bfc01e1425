"""Whether depth files have the scale of the poses and lie on their photos: the sparse points know."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.depth.sensor.at_points import AtPoints, moves
from room2dgs.errors import InputError

MIN_POINTS = 30  # over all views; fewer say nothing
MIN_VIEW_POINTS = 20  # of a view that takes part in finding a shift
MAX_SCALE_OFF = 0.03
KNOWN_UNITS_M = (1.0, 0.1, 0.01, 0.001, 0.0001, 0.00001, 1 / 5000, 1 / 6553.5, 0.00025, 0.000125)
MIN_SHIFT_PX, MIN_SHIFT = 2.0, 0.006  # pixels; share of the photo's width
MIN_GAIN = 0.02  # of the residual
MIN_SHIFT_VIEWS = 4


def check_scale(views: Sequence[AtPoints], unit_m: float) -> float | None:
    """The median ratio of depth to the points' distances; None if there are too few points to tell.

    Args:
        unit_m: metres of one stored unit with which the maps were read.

    Raises:
        InputError: it is more than `MAX_SCALE_OFF` off 1; names the unit that fits.
    """
    ratio = np.concatenate([view.ratio for view in views]) if views else np.zeros(0)
    if len(ratio) < MIN_POINTS:
        return None
    scale = float(np.median(ratio))
    if abs(scale - 1.0) > MAX_SCALE_OFF:
        raise InputError(
            f"the capture's depth files say {scale:.3g} times the distances of its {len(ratio):,} sparse points; "
            f"give prior.depth.unit_m={fitting_unit(unit_m, scale):.6g} (now {unit_m:.6g}), or scene.unit={scale:.4g} "
            "(times what it is now) if the poses are what is not in metres, or prior/depth=room_prior"
        )
    return scale


def fitting_unit(unit_m: float, scale: float) -> float:
    """The unit with which the maps fit; a usual one if it is near."""
    wanted = unit_m / scale
    near = min(KNOWN_UNITS_M, key=lambda known: abs(np.log(known / wanted)))
    return near if abs(near / wanted - 1.0) <= MAX_SCALE_OFF else wanted


def found_shift(views: Sequence[AtPoints], width: int) -> tuple[int, int] | None:
    """(right, down) pixels by which the maps have to be moved to fit the points; None if they lie right.

    The best of the moves that `at_points` tried counts if it is plainly better than none: over all views together,
    and in more of them than chance would have it (two standard deviations of a fair coin).

    Args:
        width: of the photos at their working size, pixels.
    """
    views = [view for view in views if len(view.ratio) >= MIN_VIEW_POINTS]
    if len(views) < MIN_SHIFT_VIEWS:
        return None
    off = np.stack([view.moved_off for view in views])
    weight = np.array([len(view.ratio) for view in views], dtype=np.float64)[:, None, None] * np.isfinite(off)
    total = (np.nan_to_num(off) * weight).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-9)
    total[(weight > 0).mean(axis=0) < 0.5] = np.inf
    by = moves(width)
    row, column = np.unravel_index(total.argmin(), total.shape)
    middle = len(by) // 2
    better = float((off[:, row, column] < off[:, middle, middle]).mean())
    right, down = int(by[column]), int(by[row])
    plain = total[row, column] <= (1.0 - MIN_GAIN) * total[middle, middle]
    often = better >= 0.5 + 1.0 / len(views) ** 0.5
    far = np.hypot(right, down) >= max(MIN_SHIFT_PX, MIN_SHIFT * width)
    return (right, down) if plain and often and far else None
