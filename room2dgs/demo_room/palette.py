"""Random materials: which texture, in which colours."""

from __future__ import annotations

import colorsys

import numpy as np

from room2dgs.demo_room.geometry import Material

WOODS = (
    ((0.36, 0.22, 0.12), (0.62, 0.43, 0.26)),
    ((0.50, 0.34, 0.19), (0.72, 0.55, 0.36)),
    ((0.25, 0.15, 0.10), (0.46, 0.30, 0.20)),
    ((0.58, 0.45, 0.31), (0.78, 0.66, 0.50)),
)
WHITE = (0.93, 0.92, 0.88)


def hues(rng: np.random.Generator, count: int, saturation=(0.3, 0.65), value=(0.3, 0.85)) -> tuple:
    """`count` colours (sRGB, 0-1) of related hues, every third a contrast; reds to yellows are likeliest."""
    base = rng.normal(0.06, 0.06) if rng.random() < 0.55 else rng.random()
    return tuple(
        colorsys.hsv_to_rgb(
            (base + rng.normal(0.0, 0.04) + (0.45 if k % 3 == 2 else 0.0)) % 1.0,
            rng.uniform(*saturation),
            rng.uniform(*value),
        )
        for k in range(count)
    )


def wood(rng: np.random.Generator) -> Material:
    """One of the woods."""
    return Material("grain", WOODS[rng.integers(len(WOODS))])


def floor(rng: np.random.Generator) -> Material:
    """A wooden floor."""
    return Material("planks", WOODS[rng.integers(len(WOODS))])


def wall(rng: np.random.Generator, kind: str) -> Material:
    """A papered, painted, concrete or brick wall."""
    pale = hues(rng, 1, (0.06, 0.22), (0.70, 0.85))
    colors = {
        "flowers": pale + hues(rng, 3, (0.4, 0.7), (0.35, 0.7)) + ((0.35, 0.5, 0.3),),
        "stripes": pale + hues(rng, 1, (0.2, 0.5), (0.5, 0.7)),
        "bricks": ((0.48, 0.23, 0.17), (0.74, 0.42, 0.30), (0.78, 0.75, 0.70)),
        "cracked": ((0.50, 0.49, 0.47), (0.80, 0.78, 0.74)),
        "paint": pale,
    }
    return Material(kind, colors[kind])


def cloth(rng: np.random.Generator) -> Material:
    """Upholstery or curtain cloth."""
    kind = str(rng.choice(["cloth", "plaid"]))
    return Material(kind, hues(rng, 4, (0.15, 0.6), (0.25, 0.85)))


def rug(rng: np.random.Generator) -> Material:
    """A patterned carpet."""
    return Material("rug", (*hues(rng, 4, (0.3, 0.7), (0.25, 0.7)), (0.85, 0.80, 0.68)))


def painting(rng: np.random.Generator) -> Material:
    """An abstract painting."""
    return Material("painting", hues(rng, 6, (0.3, 0.85), (0.25, 0.95)))


def poster(rng: np.random.Generator) -> Material:
    """A printed poster or newspaper."""
    return Material("poster", (WHITE, *hues(rng, 4, (0.4, 0.85), (0.3, 0.9))))


def book(rng: np.random.Generator) -> Material:
    """A book's cover."""
    cover = hues(rng, 1, (0.3, 0.85), (0.2, 0.85))[0]
    letters = (0.95, 0.92, 0.80) if max(cover) < 0.65 else (0.1, 0.1, 0.12)
    return Material("spine", (cover, letters))


def speckle(rng: np.random.Generator) -> Material:
    """Terrazzo, for pots and bowls."""
    return Material("speckle", hues(rng, 5, (0.15, 0.7), (0.35, 0.9)))


def enamel(rng: np.random.Generator) -> Material:
    """Painted metal."""
    return Material("enamel", (*hues(rng, 1, (0.1, 0.7), (0.3, 0.8)), (0.75, 0.72, 0.68)))


CARDBOARD = Material("cardboard", ((0.66, 0.50, 0.33),))
PAGES = Material("pages", ((0.90, 0.87, 0.78),))
DARK_METAL = Material("enamel", ((0.24, 0.24, 0.26), (0.45, 0.43, 0.40)))
