"""A pool of pictures that the surfaces of the random rooms share: painting each surface anew would cost too much."""

from __future__ import annotations

import colorsys
from functools import cache

import cv2
import numpy as np

from room2dgs.demo_room import palette
from room2dgs.demo_room.geometry import Material
from room2dgs.demo_room.textures import octaves, texture

SIDE = 256  # texels
PER_KIND = 10
KINDS = (
    "wood",
    "planks",
    "cloth",
    "rug",
    "wallpaper",
    "bricks",
    "plaster",
    "stains",
    "speckle",
    "tiles",
    "print",
    "spine",
    "panels",
    "screen",
    "leaf",
)


@cache
def pool(seed: int = 0) -> np.ndarray:
    """(len(KINDS) * PER_KIND, SIDE, SIDE, 3) uint8 sRGB pictures, PER_KIND of each kind in order; read only."""
    pictures = np.stack(
        [
            picture(kind, np.random.default_rng([seed, 11, number, repeat]))
            for number, kind in enumerate(KINDS)
            for repeat in range(PER_KIND)
        ]
    )
    pictures.flags.writeable = False
    return pictures


@cache
def mean_colors(seed: int = 0) -> np.ndarray:
    """(pictures, 3) float32 mean sRGB colours of `pool`, 0 to 1."""
    return pool(seed).mean(axis=(1, 2), dtype=np.float32) / 255


def picture(kind: str, rng: np.random.Generator) -> np.ndarray:
    """(SIDE, SIDE, 3) uint8 sRGB picture of a kind; about a metre wide where it has a scale."""
    texel = 1.0 / SIDE
    if kind in _PAINTED:
        material = _PAINTED[kind](rng)
        extent = _EXTENT.get(kind, 1.0)
        return _square(texture(material, (extent, extent), extent / SIDE, rng))
    return _square(_DRAWN[kind](rng, texel))


def _square(image: np.ndarray) -> np.ndarray:
    if image.dtype != np.uint8:
        image = np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)
    return image if image.shape[:2] == (SIDE, SIDE) else cv2.resize(image, (SIDE, SIDE))


def _color(rng: np.random.Generator, value=(0.15, 0.95)) -> np.ndarray:
    return np.array(colorsys.hsv_to_rgb(rng.random(), rng.random() ** 2, rng.uniform(*value)), np.float32)


def _levels(rng: np.random.Generator) -> tuple[int, int, int]:
    red, green, blue = (int(c) for c in 255 * _color(rng, (0.0, 1.0)))
    return red, green, blue


def _blend(rng: np.random.Generator, weight: np.ndarray) -> np.ndarray:
    first, second = _color(rng), _color(rng)
    return first + (second - first) * np.clip(weight, 0, 1)[..., None]


def _plaster(rng: np.random.Generator, texel: float) -> np.ndarray:
    """Fine grain of any strength on clouds of any strength."""
    fine = octaves(rng, (SIDE, SIDE), texel, 0.05) * rng.uniform(0.0, 0.06)
    coarse = octaves(rng, (SIDE, SIDE), texel, 0.6, 0.15) * rng.uniform(0.0, 0.03)
    return np.repeat((0.6 + fine + coarse)[..., None], 3, axis=2)


def _stains(rng: np.random.Generator, texel: float) -> np.ndarray:
    """Marble, concrete, dirt: bands of octave noise."""
    tone = octaves(rng, (SIDE, SIDE), texel, rng.uniform(0.2, 0.9), 0.01, rng.uniform(0.5, 0.9))
    if rng.random() < 0.4:
        tone = 1 - 2 * np.abs(tone)
    return _blend(rng, 0.5 + rng.uniform(0.15, 0.6) * tone)


def _tiles(rng: np.random.Generator, texel: float) -> np.ndarray:
    """A grid of tiles with joints, each tile of its own tone; sometimes staggered."""
    rows, columns = int(rng.integers(3, 13)), int(rng.integers(2, 9))
    v, u = np.mgrid[0:SIDE, 0:SIDE].astype(np.float32) / SIDE
    row = np.floor(v * rows)
    shift = (row % 2) * (0.5 if rng.random() < 0.4 else 0.0)
    column = np.floor(u * columns + shift).astype(int) % columns
    tones = rng.normal(0, rng.uniform(0, 0.1), (rows, columns))[row.astype(int), column]
    image = _color(rng, (0.4, 0.95)) + (tones + 0.02 * octaves(rng, (SIDE, SIDE), texel, 0.1))[..., None]
    joint = rng.uniform(0.01, 0.04)
    at_joint = ((v * rows) % 1 < joint * rows / 2) | ((u * columns + shift) % 1 < joint * columns / 2)
    image[at_joint] = _color(rng, (0.2, 0.9))
    return image


def _panels(rng: np.random.Generator, texel: float) -> np.ndarray:
    """Flat shapes on a ground: appliance fronts, labels, switches, signs."""
    image = np.full((SIDE, SIDE, 3), _levels(rng), np.uint8)
    for _ in range(int(rng.integers(1, 14))):
        x, y = rng.integers(0, SIDE, 2)
        w, h = rng.integers(4, SIDE // 2, 2)
        color = _levels(rng)
        filled = -1 if rng.random() < 0.7 else int(rng.integers(1, 4))
        if rng.random() < 0.6:
            cv2.rectangle(image, (int(x), int(y)), (int(x + w), int(y + h)), color, filled)
        else:
            cv2.circle(image, (int(x), int(y)), int(w // 3 + 2), color, filled)
    for _ in range(int(rng.integers(0, 12))):
        at = tuple(int(c) for c in rng.integers(0, SIDE, 2))
        word = "".join(chr(rng.integers(97, 123)) for _ in range(int(rng.integers(2, 9))))
        color = _levels(rng)
        cv2.putText(image, word, at, int(rng.integers(0, 6)), rng.uniform(0.3, 1.4), color, 1, cv2.LINE_AA)
    return image


def _screen(rng: np.random.Generator, texel: float) -> np.ndarray:
    """A monitor: off, or windows with lines of text."""
    if rng.random() < 0.5:
        return np.full((SIDE, SIDE, 3), int(rng.integers(3, 20)), np.uint8)
    image = _panels(rng, texel)
    for y in range(20, SIDE - 20, 9):
        cv2.line(image, (20, y), (20 + int(rng.integers(10, 200)), y), (25, 25, 25), 2)
    return image


def _leaf(rng: np.random.Generator, texel: float) -> np.ndarray:
    """Green with veins."""
    tone = octaves(rng, (SIDE, SIDE), texel, 0.3, 0.02)
    green = np.array(colorsys.hsv_to_rgb(rng.uniform(0.18, 0.42), rng.uniform(0.3, 0.8), rng.uniform(0.2, 0.6)))
    return green * (1 + 0.25 * tone)[..., None]


def _cover(rng: np.random.Generator) -> Material:
    return palette.painting(rng) if rng.random() < 0.5 else palette.poster(rng)


def _paper(rng: np.random.Generator) -> Material:
    return palette.wall(rng, str(rng.choice(["flowers", "stripes", "cracked"])))


_PAINTED = {
    "wood": palette.wood,
    "planks": palette.floor,
    "cloth": palette.cloth,
    "rug": palette.rug,
    "wallpaper": _paper,
    "bricks": lambda rng: palette.wall(rng, "bricks"),
    "speckle": palette.speckle,
    "print": _cover,
    "spine": palette.book,
}
_EXTENT = {"spine": 0.25, "print": 0.6, "speckle": 0.4}
_DRAWN = {
    "plaster": _plaster,
    "stains": _stains,
    "tiles": _tiles,
    "panels": _panels,
    "screen": _screen,
    "leaf": _leaf,
}
