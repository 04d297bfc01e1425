"""Whether depth files have the scale of the poses and lie on their photos: the sparse points know."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.depth.sensor.at_points import AtPoints, moves
from room2dgs.errors import InputError

MEDIAN_OF_NORMAL = 0.6745  # of |x|, of unit deviation
MIN_POINTS = 30  # over all views; fewer say nothing
MIN_VIEW_POINTS = 20  # of a view that takes part in finding a shift
POINT_VIEWS = 5  # photos that see a point, about; they share its error
SURE = 3.0  # standard errors
WRONG_SCALE = 0.1  # surely farther off 1: another unit, or files of another capture
OTHER_SCALE = 0.03  # farther off 1 is said; so far off are a depth camera's calibration and the points of a flat scene
KNOWN_UNITS_M = (1.0, 0.1, 0.01, 0.001, 0.0001, 0.00001, 1 / 5000, 1 / 6553.5, 0.00025, 0.000125)
MIN_SHIFT_PX, MIN_SHIFT = 2.0, 0.006  # pixels; share of the photo's width
MIN_GAIN = 0.02  # of the residual
MIN_SHIFT_VIEWS = 4


class Scale(NamedTuple):
    """Depth of the maps over the depth of the points.

    Attributes:
        value: median of all ratios.
        error: its standard error, relative.
        points: how many ratios there are.
    """

    value: float
    error: float
    points: int


def check_scale(views: Sequence[AtPoints], unit_m: float) -> Scale | None:
    """The scale of the maps by the points; None if there are too few points to tell.

    Args:
        unit_m: metres of one stored unit with which the maps were read.

    Raises:
        InputError: it is more than `WRONG_SCALE` off 1 beyond `SURE` standard errors; names the unit that fits.
    """
    ratio = np.concatenate([view.ratio for view in views]) if views else np.zeros(0)
    if len(ratio) < MIN_POINTS:
        return None
    scale = _scale(ratio)
    if abs(np.log(scale.value)) - SURE * scale.error > np.log1p(WRONG_SCALE):
        raise InputError(f"{_found(scale)}; {_units(scale, unit_m)}, or prior/depth=room_prior")
    return scale


def scale_warning(scale: Scale, unit_m: float) -> str | None:
    """What to say of a scale that is off and not refused; None if the points do not tell it from 1."""
    off = abs(np.log(scale.value))
    if off <= max(np.log1p(OTHER_SCALE), SURE * scale.error):
        return None
    return (
        f"WARNING: {_found(scale)}: too little for a wrong unit, so they are used as they are, and lengths may be off "
        f"by that much; if the depth camera is known to be right or wrong by it, {_units(scale, unit_m)}"
    )


def _scale(ratio: np.ndarray) -> Scale:
    """Median, and its standard error by the median deviation; photos that see one point count as one."""
    logs = np.log(ratio)
    middle = float(np.median(logs))
    deviation = float(np.median(np.abs(logs - middle))) / MEDIAN_OF_NORMAL
    count = max(len(ratio) / POINT_VIEWS, 1.0)
    return Scale(float(np.exp(middle)), deviation * float(np.sqrt(np.pi / (2 * count))), len(ratio))


def _found(scale: Scale) -> str:
    return (
        f"the capture's depth files say {scale.value:.3g} (± {scale.error:.1%}) times the distances of its sparse "
        f"points, at {scale.points:,} pixels"
    )


def _units(scale: Scale, unit_m: float) -> str:
    return (
        f"give prior.depth.unit_m={fitting_unit(unit_m, scale.value):.6g} (now {unit_m:.6g}), or "
        f"scene.unit={scale.value:.4g} (times what it is now) if the poses are what is not in metres"
    )


def fitting_unit(unit_m: float, scale: float) -> float:
    """The unit with which the maps fit; a usual one if it is near."""
    wanted = unit_m / scale
    near = min(KNOWN_UNITS_M, key=lambda known: abs(np.log(known / wanted)))
    return near if abs(near / wanted - 1.0) <= OTHER_SCALE else wanted


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
