"""Random materials of the random rooms: a picture of the pool, a colour, a contrast, a gloss."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np

from room2dgs.demo_room.geometry import Material
from room2dgs.tools.random_rooms.pictures import KINDS, PER_KIND

Rng = np.random.Generator
SILVERED = 2.0  # gloss of a mirror
Color = tuple[float, float, float]


@dataclass(frozen=True)
class Surface(Material):
    """A picture of the pool on a surface.

    Attributes:
        picture: index into `pictures.pool()`.
        repeat: metres that the picture covers; None = the picture fills the patch.
        tint: mean colour, sRGB 0 to 1; None = the picture's own.
        contrast: strength of the picture's deviations from its mean.
        gloss: weight of the mirror reflection's Fresnel term, 0 to 1; above it the surface is silvered.
        roughness: spread of the mirrored rays, radians.
    """

    picture: int = 0
    repeat: float | None = 1.0
    tint: Color | None = None
    contrast: float = 1.0
    gloss: float = 0.0
    roughness: float = 0.0


@dataclass(frozen=True)
class Light(Material):
    """An emitter.

    Attributes:
        radiance: linear, relative to the other lights of the room.
    """

    radiance: Color = (1.0, 1.0, 1.0)


def lamp(rng: Rng) -> Light:
    """A lamp: white to warm, strong for its size."""
    warm = rng.uniform(0.0, 1.0)
    power = float(np.exp(rng.uniform(np.log(2.0), np.log(12.0))))
    return Light("emitter", radiance=(power, power * (1 - 0.15 * warm), power * (1 - 0.45 * warm)))


def daylight(rng: Rng) -> Light:
    """A window's pane: neutral to bluish."""
    cold = rng.uniform(-0.2, 1.0)
    power = float(np.exp(rng.uniform(np.log(0.4), np.log(4.0))))
    return Light("emitter", radiance=(power * (1 - 0.15 * cold), power, power * (1 + 0.1 * cold)))


def wall(rng: Rng) -> Surface:
    """Mostly plain paint, else paper, plaster, bricks, tiles, panels."""
    if rng.random() < 0.68:
        return _surface(rng, "plaster", tint=_paint(rng), contrast=rng.choice([0.0, 0.5, 1.0]))
    kind = str(rng.choice(["wallpaper", "bricks", "stains", "tiles", "planks"], p=[0.4, 0.15, 0.15, 0.2, 0.1]))
    return _surface(rng, kind, tint=_paint(rng) if rng.random() < 0.6 else None)


def ceiling(rng: Rng) -> Surface:
    """Nearly white paint; rarely planks or anything."""
    if rng.random() < 0.85:
        return _surface(rng, "plaster", tint=_hsv(rng, (0, 0.12), (0.6, 0.98)), contrast=rng.uniform(0, 1))
    return wall(rng)


def blank_paint(rng: Rng, pale: bool = False) -> Surface:
    """Paint without any texture; `pale`: nearly white."""
    tint = _hsv(rng, (0, 0.06), (0.75, 0.97)) if pale else _paint(rng)
    return _surface(rng, "plaster", tint=tint, contrast=0.0)


def floor(rng: Rng) -> Surface:
    """Planks, tiles, stone, carpet, concrete; often glossy."""
    kind = str(
        rng.choice(
            ["planks", "tiles", "stains", "speckle", "cloth", "plaster", "rug"],
            p=[0.34, 0.2, 0.12, 0.08, 0.1, 0.12, 0.04],
        )
    )
    tint = _hsv(rng, (0.0, 0.5), (0.1, 0.85)) if rng.random() < 0.6 else None
    gloss = rng.uniform(0.2, 1.0) if rng.random() < 0.45 and kind not in ("cloth", "rug") else 0.0
    return _surface(rng, kind, tint=tint, gloss=gloss)


def wood(rng: Rng) -> Surface:
    """Grain in any brown, or stained."""
    tint = None if rng.random() < 0.5 else _hsv(rng, (0.1, 0.6), (0.1, 0.85), hue=(0.04, 0.12))
    return _surface(rng, "wood", tint=tint, gloss=_some_gloss(rng, 0.3))


def painted(rng: Rng) -> Surface:
    """Painted or laminated furniture: often white, grey or black, else any colour."""
    if rng.random() < 0.25:
        return wood(rng)
    return _surface(rng, "plaster", tint=_furniture(rng), contrast=rng.choice([0.0, 0.4]), gloss=_some_gloss(rng, 0.45))


def cloth(rng: Rng) -> Surface:
    """Upholstery, bedding, curtains: patterned or plain."""
    if rng.random() < 0.5:
        return _surface(rng, "cloth", repeat=rng.uniform(0.4, 1.5))
    return _surface(rng, "plaster", tint=_any_color(rng), contrast=rng.uniform(0, 1.5), repeat=0.3)


def rug(rng: Rng) -> Surface:
    """A patterned carpet, or plain."""
    return _surface(rng, "rug", repeat=None) if rng.random() < 0.6 else cloth(rng)


def metal(rng: Rng) -> Surface:
    """Brushed steel, chrome, black iron."""
    tint = _hsv(rng, (0, 0.08), rng.choice([[0.03, 0.25], [0.4, 0.8]]))
    return _surface(rng, "plaster", tint=tint, gloss=rng.uniform(0.4, 1.0), roughness=rng.uniform(0.0, 0.2))


def plastic(rng: Rng) -> Surface:
    """One colour, more or less shiny."""
    return _surface(rng, "plaster", tint=_any_color(rng), contrast=0.0, gloss=_some_gloss(rng, 0.7))


def ceramic(rng: Rng) -> Surface:
    """White or coloured glaze."""
    tint = _hsv(rng, (0, 0.15), (0.75, 0.98)) if rng.random() < 0.5 else _any_color(rng)
    return _surface(rng, str(rng.choice(["plaster", "speckle"])), tint=tint, gloss=rng.uniform(0.3, 1.0))


def glass_like(rng: Rng) -> Surface:
    """Dark and mirroring: a hob, an oven's door, a bottle."""
    tint = _hsv(rng, (0, 0.6), (0.01, 0.2))
    return _surface(rng, "plaster", tint=tint, contrast=0.0, gloss=1.0)


def silver(rng: Rng) -> Surface:
    """A mirror: it reflects nearly all light, whatever the angle."""
    return _surface(rng, "plaster", tint=(0.05, 0.05, 0.05), contrast=0.0, gloss=SILVERED, roughness=0.0)


def picture(rng: Rng) -> Surface:
    """A painting, poster or sign that fills its patch."""
    return _surface(rng, str(rng.choice(["print", "panels"])), repeat=None, gloss=_some_gloss(rng, 0.3))


def book(rng: Rng) -> Surface:
    """A book's cover or spine."""
    if rng.random() < 0.5:
        return _surface(rng, "spine", repeat=None)
    return _surface(rng, "plaster", tint=_any_color(rng), contrast=0.0)


def screen(rng: Rng) -> Surface:
    """A monitor or television."""
    return _surface(rng, "screen", repeat=None, gloss=_some_gloss(rng, 0.6))


def plant(rng: Rng) -> Surface:
    """Leaves and stems."""
    return _surface(rng, "leaf", repeat=0.5)


def cardboard(rng: Rng) -> Surface:
    """Brown or printed board."""
    if rng.random() < 0.5:
        return _surface(rng, "plaster", tint=_hsv(rng, (0.25, 0.5), (0.4, 0.75), hue=(0.06, 0.11)))
    return picture(rng)


def tile(rng: Rng) -> Surface:
    """Wall tiles."""
    return _surface(rng, "tiles", repeat=rng.uniform(0.4, 1.6), gloss=_some_gloss(rng, 0.6))


def stone(rng: Rng) -> Surface:
    """A counter top: stone, terrazzo, laminate, steel."""
    kind = str(rng.choice(["stains", "speckle", "plaster", "wood"]))
    tint = _hsv(rng, (0, 0.3), (0.05, 0.95)) if rng.random() < 0.7 else None
    return _surface(rng, kind, tint=tint, gloss=_some_gloss(rng, 0.6))


def anything(rng: Rng) -> Surface:
    """Any picture in any colour."""
    kind = str(rng.choice(KINDS))
    return _surface(rng, kind, tint=_any_color(rng) if rng.random() < 0.5 else None, gloss=_some_gloss(rng, 0.25))


def _surface(
    rng: Rng,
    kind: str,
    tint: Color | None = None,
    repeat: float | None = 1.0,
    contrast: float | None = None,
    gloss: float = 0.0,
    roughness: float | None = None,
) -> Surface:
    return Surface(
        "swatch",
        picture=KINDS.index(kind) * PER_KIND + int(rng.integers(PER_KIND)),
        repeat=None if repeat is None else repeat * float(np.exp(rng.normal(0, 0.35))),
        tint=tint,
        contrast=float(np.clip(rng.lognormal(0, 0.3), 0.3, 2.0) if contrast is None else contrast),
        gloss=float(gloss),
        roughness=float(abs(rng.normal(0, 0.04)) if roughness is None else roughness),
    )


def _some_gloss(rng: Rng, chance: float) -> float:
    return float(rng.uniform(0.1, 1.0)) if rng.random() < chance else 0.0


def _hsv(rng: Rng, saturation, value, hue=(0.0, 1.0)) -> Color:
    return colorsys.hsv_to_rgb(rng.uniform(*hue), rng.uniform(*saturation), rng.uniform(*value))


def _paint(rng: Rng) -> Color:
    """What walls are painted: whites and greys, pale colours, now and then a strong one."""
    draw = rng.random()
    if draw < 0.62:
        return _hsv(rng, (0.0, 0.08), (0.45, 0.97), hue=(0.05, 0.65))
    return _hsv(rng, (0.05, 0.3), (0.5, 0.95)) if draw < 0.9 else _hsv(rng, (0.2, 0.8), (0.15, 0.8))


def _furniture(rng: Rng) -> Color:
    draw = rng.random()
    if draw < 0.45:
        return _hsv(rng, (0.0, 0.08), (0.75, 0.97))
    if draw < 0.65:
        return _hsv(rng, (0.0, 0.1), (0.03, 0.6))
    return _hsv(rng, (0.1, 0.8), (0.15, 0.9))


def _any_color(rng: Rng) -> Color:
    return _hsv(rng, (0, 0.2), (0.02, 0.97)) if rng.random() < 0.4 else _hsv(rng, (0.1, 0.95), (0.1, 0.95))
