"""Exposure and white balance of a capture's photos: found, judged, told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from room2dgs.captures.levelled import RGBGains
from room2dgs.captures.point_cloud import Tracks
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.exposure.gains import Gains, estimated_gains
from room2dgs.exposure.observed import observed
from room2dgs.exposure.places import on_surfaces, on_tracks, together

SURE = 0.03  # expected error of a logarithm up to which a photo's gain is known
# and places that have to tie it to other photos: few sparse points may all lie on one glossy thing beside a window
LEAST_PLACES = 100
LEAST_PHOTOS = 5  # that tell whether gains follow the order of the photos
DIGITS = 5
MOST = 0.9  # of the photos lie within what is called the variation


class Variation(NamedTuple):
    """By what share nine photos of ten differ from the middle, both ways.

    Attributes:
        exposure: of the levels.
        white_balance: of red against green, or blue against green, whichever is more.
    """

    exposure: float
    white_balance: float


def photo_gains(
    frames: Sequence[Frame], tracks: Tracks | None, maps: Mapping[str, ViewMaps[np.ndarray]]
) -> Gains | None:
    """Gains of the photos, from sparse points and from the surfaces that depth shows; None if no places are shared.

    Args:
        tracks: of sparse points; None: there are none.
        maps: depth by frame name; frames may have none.

    Raises:
        InputError: a photo cannot be decoded.
    """
    kinds = [] if tracks is None else [on_tracks(frames, tracks)]
    first = 0 if tracks is None or not len(tracks) else int(tracks.point.max()) + 1
    kinds.append(on_surfaces(frames, maps, first))
    seen = observed(frames, [together(parts) for parts in zip(*kinds, strict=True)])
    gains = estimated_gains(seen, len(frames))
    return gains if known(gains).any() else None


def known(gains: Gains) -> np.ndarray:
    """(V,) bool: photos whose gains are more than a guess."""
    least, worst = gains.error.min(axis=1), gains.error.max(axis=1)
    return np.asarray((least > 0) & (worst < SURE) & (gains.places >= LEAST_PLACES))  # 0: of no observation at all


def variation(gains: Gains) -> Variation:
    """Of the photos whose gains are known."""
    log = gains.log[known(gains)]
    if not len(log):
        return Variation(0.0, 0.0)
    balance = log[:, [0, 2]] - log[:, [1]]
    return Variation(_half_width(log.mean(axis=1)[:, None]), _half_width(balance))


def gains_by_name(scene: Scene, gains: Gains) -> dict[str, RGBGains]:
    """Factors of the levels of the photos that they are known of, and of held-out ones as `expected` has them."""
    sure = known(gains)
    logs = {frame.name: log for frame, log, is_known in zip(scene.train, gains.log, sure, strict=True) if is_known}
    order = np.array([frame.index for frame, is_known in zip(scene.train, sure, strict=True) if is_known])
    held_out = expected(order, gains.log[sure], np.array([frame.index for frame in scene.test]))
    logs |= {frame.name: log for frame, log in zip(scene.test, held_out, strict=True)}
    return {name: _factors(log) for name, log in logs.items()}


def with_gains(scene: Scene, gains: Mapping[str, RGBGains]) -> Scene:
    """The scene whose photos know their gains; those that are not named have none."""
    train, test = (
        tuple(replace(frame, gains=gains.get(frame.name)) for frame in frames) for frames in (scene.train, scene.test)
    )
    return replace(scene, train=train, test=test)


def expected(order: np.ndarray, logs: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(N, 3) logarithms of gains of photos that nothing is known of but when they were taken.

    Between those of the photos before and after, if that tells the known ones' own gains better than their mean does;
    else 0, the mean.

    Args:
        order: (V,) places of the photos with known gains in the capture's order, rising.
        logs: (V, 3) of these.
        at: (N,) places of the others.
    """
    if len(order) < LEAST_PHOTOS:
        return np.zeros((len(at), 3))
    share = ((order[1:-1] - order[:-2]) / (order[2:] - order[:-2]))[:, None]
    between = (1 - share) * logs[:-2] + share * logs[2:]
    if ((logs[1:-1] - between) ** 2).sum() >= (logs[1:-1] ** 2).sum():
        return np.zeros((len(at), 3))
    return np.stack([np.interp(at, order, column) for column in logs.T], axis=1)


def _factors(log: np.ndarray) -> RGBGains:
    red, green, blue = np.exp(log).round(DIGITS).tolist()
    return red, green, blue


def _half_width(logs: np.ndarray) -> float:
    """Of the widest column."""
    low, high = np.percentile(logs, [50 * (1 - MOST), 50 * (1 + MOST)], axis=0)
    return float(np.expm1((high - low) / 2).max())
