"""From linear radiance to a photo: what lens, sensor and file do to it, drawn at random."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from room2dgs.tools.phone_camera.photo import phone_photo

# coding of radiance on disk: 255 * (L / CODED_MAX)^(1 / CODED_GAMMA)
CODED_MAX, CODED_GAMMA = 4.0, 2.2
LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
TONE_STEPS = 4096
# brightest linear value that the tone curves tell from white
TONE_MAX = 4.0
PHONES = 0.5  # share of the photos that a phone takes
NOISE_TILE = 512


@cache
def _radiance_table() -> np.ndarray:
    return (CODED_MAX * (np.arange(256) / 255.0) ** CODED_GAMMA).astype(np.float32)


def linear_radiance(coded: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 as on disk -> float32 linear; 1 is display white at gain 1."""
    return cv2.LUT(coded, _radiance_table())


def photo(coded: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A photo of the radiance, with random exposure, colours, blur, noise, tone and compression.

    A share is as phones take them (`phone_camera.photo`), with local tone mapping, smeared noise and halos; the others
    vary more than any camera does.

    Args:
        coded: (H, W, 3) uint8 radiance as on disk.
        rng: decides everything.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    light = linear_radiance(coded)
    light = _blurred(light, rng)
    light = cv2.transform(light, _colour_matrix(light, rng))
    if rng.random() < PHONES:
        return phone_photo(light, int(rng.integers(2**63)))
    if rng.random() < 0.5:
        light *= _vignette(light.shape[:2], float(rng.uniform(0.1, 0.6)))[..., None]
    light = _with_noise(light, rng)
    image = _toned(light, rng)
    image = _softened(image, rng)
    return _compressed(image, rng)


def _blurred(light: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Defocus or motion, sometimes."""
    kind = rng.random()
    if kind < 0.3:
        return cv2.GaussianBlur(light, (0, 0), float(rng.uniform(0.3, 1.4)))
    if kind < 0.45:
        length, angle = rng.uniform(1.5, 7.0), rng.uniform(0.0, np.pi)
        kernel = np.zeros((9, 9), np.float32)
        along = np.linspace(-length / 2.0, length / 2.0, 33)
        x, y = 4.0 + along * np.cos(angle), 4.0 + along * np.sin(angle)
        np.add.at(kernel, (np.round(y).astype(int), np.round(x).astype(int)), np.float32(1.0 / 33.0))
        return cv2.filter2D(light, -1, kernel, borderType=cv2.BORDER_REFLECT_101)
    return light


def _colour_matrix(light: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(3, 3) white balance, saturation, hue, channel order and exposure in one."""
    few = light[::4, ::4].reshape(-1, 3)
    means = few.mean(axis=0) + 1e-3
    # a camera takes away a part of the light's colour, and errs
    balance = (means.mean() / means) ** rng.uniform(0.0, 1.0) * np.exp(rng.normal(0.0, 0.08, 3))
    saturation = 0.0 if rng.random() < 0.05 else rng.uniform(0.6, 1.5)
    to_grey = np.outer(np.ones(3), LUMA)
    matrix = (to_grey + saturation * (np.eye(3) - to_grey)) @ np.diag(balance)
    if rng.random() < 0.3:
        matrix = _hue(rng.normal(0.0, 0.25)) @ matrix
    if rng.random() < 0.1:
        matrix = matrix[rng.permutation(3)]
    # the geometric mean: a bright window must not leave the room black
    key = np.exp(np.log(np.maximum(few @ (LUMA @ matrix), 1e-3)).mean())
    wanted = rng.uniform(0.28, 0.62) ** 2.2 * np.exp(rng.normal(0.0, 0.2))
    return (matrix * (wanted / key)).astype(np.float32)


def _hue(angle: float) -> np.ndarray:
    """(3, 3) turn about the grey axis."""
    turn, _ = cv2.Rodrigues(np.full(3, angle / np.sqrt(3.0)))
    return turn


@cache
def _radius_squared(shape: tuple[int, int]) -> np.ndarray:
    height, width = shape
    y, x = np.mgrid[0:height, 0:width]
    squared = (x + 0.5 - width / 2.0) ** 2 + (y + 0.5 - height / 2.0) ** 2
    return (squared / squared.max()).astype(np.float32)


def _vignette(shape: tuple[int, int], strength: float) -> np.ndarray:
    return 1.0 - np.float32(strength) * _radius_squared(shape)


@cache
def _noise_tile() -> np.ndarray:
    """(NOISE_TILE, NOISE_TILE, 3) unit normal noise; drawing a crop of it is twenty times faster than drawing anew."""
    return np.random.default_rng(0).standard_normal((NOISE_TILE, NOISE_TILE, 3), dtype=np.float32)


def _noise_crop(height: int, width: int, rng: np.random.Generator) -> np.ndarray:
    tile = _noise_tile()
    if height > NOISE_TILE or width > NOISE_TILE:
        return rng.standard_normal((height, width, 3), dtype=np.float32)
    y, x = rng.integers(0, NOISE_TILE - height + 1), rng.integers(0, NOISE_TILE - width + 1)
    return tile[y : y + height, x : x + width]


def _with_noise(light: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Shot and read noise; a part of it is coarser than a pixel, as after demosaicing and denoising."""
    height, width = light.shape[:2]
    if rng.random() < 0.15:
        return light
    read, shot = np.exp(rng.uniform(np.log(5e-4), np.log(8e-3))), np.exp(rng.uniform(np.log(1e-5), np.log(2e-3)))
    noise = _noise_crop(height, width, rng)
    if rng.random() < 0.5:
        coarse = _noise_crop((height + 1) // 2, (width + 1) // 2, rng)
        noise = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    deviation = np.sqrt(np.float32(read**2) + np.float32(shot) * np.maximum(light, 0.0))
    return light + deviation * noise


def _toned(light: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Linear -> (H, W, 3) uint8 by a random curve from 0 to white, through a table."""
    # steps even in sqrt(light): the eye's and the curve's dark end needs the finer ones
    x = (np.arange(TONE_STEPS) / (TONE_STEPS - 1)) ** 2 * TONE_MAX
    kind = rng.random()
    if kind < 0.3:
        shoulder = rng.uniform(1.2, 4.0)
        x = x * (1.0 + x / shoulder**2) / (1.0 + x)  # Reinhard 2002, eq. 4: white at `shoulder`
        x = x * rng.uniform(1.1, 1.6)
    y = np.clip(x, 0.0, 1.0) ** (1.0 / rng.uniform(1.9, 2.6))
    if rng.random() < 0.5:
        contrast = rng.uniform(-0.25, 0.6)
        y = y + contrast * (y * y * (3.0 - 2.0 * y) - y)
    black = rng.uniform(-0.03, 0.06) if rng.random() < 0.3 else 0.0
    y = black + (1.0 - black) * y
    table = np.round(255.0 * np.clip(y, 0.0, 1.0)).astype(np.uint8)
    root = np.sqrt(np.clip(light, 0.0, TONE_MAX)) * np.float32((TONE_STEPS - 1) / np.sqrt(TONE_MAX))
    return table[(root + np.float32(0.5)).astype(np.uint16)]


def _softened(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A smaller photo enlarged, or one sharpened too much, sometimes."""
    kind = rng.random()
    if kind < 0.2:
        height, width = image.shape[:2]
        factor = rng.uniform(0.4, 0.9)
        small = (max(8, round(width * factor)), max(8, round(height * factor)))
        return cv2.resize(cv2.resize(image, small, interpolation=cv2.INTER_AREA), (width, height))
    if kind < 0.35:
        amount = float(rng.uniform(0.3, 1.2))
        return cv2.addWeighted(image, 1.0 + amount, cv2.GaussianBlur(image, (0, 0), 1.0), -amount, 0.0)
    return image


def _compressed(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    quality = int(rng.integers(30, 96))
    if rng.random() < 0.3:
        return image
    # channel order only decides which chroma is coarser; it need not be converted twice
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert decoded is not None
    return decoded[..., ::-1]
