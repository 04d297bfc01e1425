"""Decodes masks: grey, palettes, 1, 8 or 16 bits, values 0 and 1, or an alpha channel.

What a mask's numbers mean is one rule for all masks of a capture: a photo whose mask is 0 all over is hidden all over,
whatever the largest number of its own mask.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image

from room2dgs.captures.photo_header import opened
from room2dgs.captures.photos import Photo
from room2dgs.captures.turned_photo import TurnedPhoto, turned
from room2dgs.errors import InputError
from room2dgs.parallel_map import parallel_map

HALF = {8: 127, 16: 32767}  # brighter may be used
OPAQUE = 127  # of 255; an alpha above may be used
SMALL = (48, 36)  # pixels of what is kept of a mask to judge it by
LOSSY = ("JPEG", "MPO", "WEBP")


class MaskImage(NamedTuple):
    """A mask as it is stored.

    Attributes:
        values: (H, W) the brightest of a pixel's channels; 255 for every colour of labels that is not black.
        alpha: (H, W) uint8; None: it has none.
    """

    values: np.ndarray
    alpha: np.ndarray | None


@dataclass(frozen=True)
class MaskRule:
    """What the numbers of a capture's masks mean.

    Attributes:
        by_alpha: the mask lies in the alpha channel; False: in the colours.
        labels: the colours hold small numbers, and all but 0 may be used; False: what is brighter than half.
    """

    by_alpha: bool = False
    labels: bool = False

    def usable(self, mask: MaskImage) -> np.ndarray:
        """(H, W) bool: what may be used."""
        if self.by_alpha and mask.alpha is not None:
            return mask.alpha > OPAQUE
        return mask.values > (0 if self.labels else HALF[_bits(mask.values)])


class MaskFacts(NamedTuple):
    """What a mask tells of the rule, and enough of it to be judged by.

    Attributes:
        greatest: of its values, as a share of what its number of bits can hold.
        alpha: (least, greatest); None: it has none.
        small: the mask at `SMALL`.
        brightest: the one pixel that may be used if any may; of values and alpha.
    """

    greatest: float
    alpha: tuple[int, int] | None
    small: MaskImage
    brightest: MaskImage


class Masks:
    """All masks of a capture.

    Args:
        photos: the masks of the views that are used.
    """

    def __init__(self, photos: Sequence[Photo]) -> None:
        self._photos = tuple(dict.fromkeys(photos))
        self._lock = Lock()
        self._facts: dict[Photo, MaskFacts | InputError] | None = None

    def facts(self) -> dict[Photo, MaskFacts | InputError]:
        """Of each mask, which are all decoded the first time; an error of one that cannot be."""
        with self._lock:
            if self._facts is None:
                self._facts = dict(zip(self._photos, parallel_map(_facts, self._photos), strict=True))
            return self._facts

    @cached_property
    def rule(self) -> MaskRule:
        return rule_of([one for one in self.facts().values() if isinstance(one, MaskFacts)])


def rule_of(facts: Sequence[MaskFacts]) -> MaskRule:
    """What the numbers mean by what all masks hold."""
    alphas = [one.alpha for one in facts if one.alpha is not None]
    by_alpha = bool(alphas) and min(low for low, _ in alphas) < max(high for _, high in alphas)
    return MaskRule(by_alpha, labels=max((one.greatest for one in facts), default=1.0) < 0.5)


def facts_of(mask: MaskImage) -> MaskFacts:
    greatest = float(mask.values.max(initial=0)) / (2 ** _bits(mask.values) - 1)
    alpha = None if mask.alpha is None else (int(mask.alpha.min()), int(mask.alpha.max()))
    best = MaskImage(mask.values.max(keepdims=True), None if alpha is None else np.full((1, 1), alpha[1], np.uint8))
    small = MaskImage(_small(mask.values), None if mask.alpha is None else _small(mask.alpha))
    return MaskFacts(greatest, alpha, small, best)


def mask_image(photo: Photo) -> MaskImage:
    """Decode a mask.

    Raises:
        InputError: it cannot be.
    """
    if isinstance(photo, TurnedPhoto):
        inner = mask_image(photo.photo)
        alpha = None if inner.alpha is None else turned(inner.alpha, photo.orientation)
        return MaskImage(turned(inner.values, photo.orientation), alpha)
    with opened(photo) as image:
        if image is None:
            return MaskImage(photo.pixels().max(axis=-1), None)
        image.load()
        alpha = alpha_of_image(image)
        if image.mode in ("1", "L", "LA", "La"):
            return MaskImage(np.array(image.convert("L") if image.mode == "1" else image.getchannel(0)), alpha)
        if image.mode.startswith(("I", "F")):
            return MaskImage(_deep(np.array(image)), alpha)
        if image.mode in ("P", "PA"):
            return MaskImage(_of_palette(image), alpha)
        colours = np.array(image.convert("RGB"))
        return MaskImage(_of_colours(colours, image.format not in LOSSY), alpha)


def alpha_of(photo: Photo) -> np.ndarray | None:
    """(H, W) uint8: how opaque a photo's pixels are; None: all are.

    Raises:
        InputError: it cannot be decoded.
    """
    if isinstance(photo, TurnedPhoto):
        alpha = alpha_of(photo.photo)
        return None if alpha is None else turned(alpha, photo.orientation)
    with opened(photo) as image:
        if image is None or not image.has_transparency_data:
            return None
        image.load()
        alpha = alpha_of_image(image)
    return None if alpha is None or alpha.min() == 255 else alpha


def alpha_of_image(image: Image.Image) -> np.ndarray | None:
    """(H, W) uint8 of a decoded image; None: its mode has none."""
    if not image.has_transparency_data:
        return None
    return np.array(image.getchannel("A") if "A" in image.getbands() else image.convert("RGBA").getchannel("A"))


def _facts(photo: Photo) -> MaskFacts | InputError:
    try:
        return facts_of(mask_image(photo))
    except InputError as error:
        return error


def _bits(values: np.ndarray) -> int:
    return 16 if values.dtype == np.uint16 else 8


def _deep(values: np.ndarray) -> np.ndarray:
    """(H, W) uint16 of whole numbers; of fractions up to 1 too."""
    values = np.nan_to_num(values)
    if values.dtype.kind == "f" and values.max(initial=0) <= 1:
        values = values * 65535
    return values.clip(0, 65535).astype(np.uint16)


def _of_palette(image: Image.Image) -> np.ndarray:
    colours = np.array(image.convert("RGB"))
    if not colours.any():  # they say nothing: the labels' numbers do
        return np.array(image if image.mode == "P" else image.getchannel(0))
    return _of_colours(colours, True)


def _of_colours(colours: np.ndarray, exact: bool) -> np.ndarray:
    """(H, W) uint8 brightness of (H, W, 3) colours; of labels, which have hues, 255 for all but black.

    Args:
        exact: no codec has added hues of its own.
    """
    red, green, blue = np.moveaxis(colours, -1, 0)
    greatest = np.maximum(np.maximum(red, green), blue)
    if exact and ((red != green) | (green != blue)).any():
        return np.where(greatest > 0, np.uint8(255), np.uint8(0))
    return greatest


def _small(values: np.ndarray) -> np.ndarray:
    return cv2.resize(values, SMALL, interpolation=cv2.INTER_NEAREST)
