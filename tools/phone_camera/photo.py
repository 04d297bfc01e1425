"""From light to a phone's photo."""

from __future__ import annotations

from collections.abc import Collection

import cv2
import numpy as np

from room2dgs.demo_room.atlas import linear_to_srgb, srgb_to_linear
from room2dgs.tools.phone_camera.effects import OF_PHOTO
from room2dgs.tools.phone_camera.phone import Phone, random_phone

LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
DARKEST = np.float32(1e-3)  # linear; logarithms go no deeper
NORMAL_WIDTH = 640  # pixels; lengths of filters are those of a photo of this width
NEIGHBOURHOOD = 40.0  # pixels at the normal width: what the local tone mapping calls local
KEY = np.float32(0.18)  # linear: middle grey, which the local tone mapping leaves


def phone_photo(
    light: np.ndarray,
    seed: int | list[int],
    phone: Phone | None = None,
    effects: Collection[str] = frozenset(OF_PHOTO),
) -> np.ndarray:
    """A phone's photo of the light.

    Args:
        light: (H, W, 3) float32, linear, 1 = white.
        seed: decides the noise, and the phone if none is given.
        phone: that takes it; None: one of its own.
        effects: names of `effects.OF_PHOTO`; others are passed over.

    Returns:
        (H, W, 3) uint8 RGB; sRGB levels without any effect.
    """
    rng = np.random.default_rng(seed)
    drawn = random_phone(rng)
    phone = phone or drawn
    size = light.shape[1] / NORMAL_WIDTH
    light = light.astype(np.float32)
    if "vignette" in effects:
        light = light * vignette(light.shape[:2], phone.vignette)[..., None]
    if "noise" in effects:
        deviation = np.sqrt(np.float32(phone.read**2) + np.float32(phone.shot) * np.maximum(light, 0))
        light = light + deviation * rng.standard_normal(light.shape, dtype=np.float32)
    light = np.maximum(light, 0)
    if "tone" in effects:
        light = locally_toned(light, phone.lift, NEIGHBOURHOOD * size)
    levels = responded(light, phone) if "response" in effects else linear_to_srgb(light)
    if "smear" in effects:
        levels = smeared(levels, phone.smear, phone.wash * size)
    if "sharpening" in effects:
        levels = sharpened(levels, phone.sharpening, phone.halo, size)
    photo = np.round(255 * np.clip(levels, 0, 1)).astype(np.uint8)
    return compressed(photo, phone.jpeg_quality) if "jpeg" in effects else photo


def phone_photo_of(
    photo: np.ndarray,
    seed: int | list[int],
    phone: Phone | None = None,
    effects: Collection[str] = frozenset(OF_PHOTO),
) -> np.ndarray:
    """The same of an (H, W, 3) uint8 sRGB photo, which is taken for light that was never clipped."""
    return phone_photo(srgb_to_linear(photo), seed, phone, effects)


def vignette(shape: tuple[int, int], strength: float) -> np.ndarray:
    """(H, W) float32 factors: 1 in the middle, 1 - strength in the corners."""
    height, width = shape
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) + np.float32(0.5)
    squared = (x - width / 2) ** 2 + (y - height / 2) ** 2
    return (1 - strength * squared / ((width / 2) ** 2 + (height / 2) ** 2)).astype(np.float32)


def locally_toned(light: np.ndarray, lift: float, radius_px: float) -> np.ndarray:
    """Light divided by a power of the light around it: a blur that knows no edges, so that bright things have rims."""
    luma = np.log(np.maximum(light @ LUMA, DARKEST))
    around = cv2.GaussianBlur(luma, (0, 0), radius_px)
    return light * np.exp(-np.float32(lift) * (around - np.log(KEY)))[..., None]


def responded(light: np.ndarray, phone: Phone) -> np.ndarray:
    """(H, W, 3) levels 0..1 of light: saturation, a power, an S."""
    grey = (light @ LUMA)[..., None]
    light = np.clip(grey + np.float32(phone.saturation) * (light - grey), 0, 1)
    levels = light ** np.float32(1 / phone.gamma)
    bent = levels * levels * (3 - 2 * levels)
    return levels + np.float32(phone.contrast) * (bent - levels)


def smeared(levels: np.ndarray, noise: float, wash_px: float) -> np.ndarray:
    """Brightness is smoothed where it differs by less than `noise`, colours over `wash_px` whatever they are."""
    luma = levels @ LUMA
    smooth = cv2.bilateralFilter(luma, 5, 2 * noise, 2.0)
    chroma = levels - luma[..., None]
    return smooth[..., None] + cv2.GaussianBlur(chroma, (0, 0), max(wash_px, 0.3))


def sharpened(levels: np.ndarray, amount: float, halo: float, size: float) -> np.ndarray:
    """Fine and coarser detail of the brightness is added once more."""
    luma = levels @ LUMA
    fine = luma - cv2.GaussianBlur(luma, (0, 0), max(size, 0.5))
    coarse = luma - cv2.GaussianBlur(luma, (0, 0), 3 * max(size, 0.5))
    return levels + (np.float32(amount) * fine + np.float32(halo) * coarse)[..., None]


def compressed(photo: np.ndarray, quality: int) -> np.ndarray:
    """As it comes out of a JPEG file with colours of half the size."""
    data = cv2.imencode(".jpg", photo[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert decoded is not None
    return decoded[..., ::-1]
