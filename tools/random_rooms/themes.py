"""What kinds of rooms there are: which pieces stand at the walls, which in the middle, how many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch
from room2dgs.tools.random_rooms import bathroom, extras, fittings, kitchen, materials, plants, seats, storage, tables
from room2dgs.tools.random_rooms.style import Style

Rng = np.random.Generator
Builder = Callable[[Rng, Style], list[Patch]]


def house_plant(rng: Rng, style: Style) -> list[Patch]:
    """A plant about the origin."""
    return plants.plant(rng)


def dark_lamp(rng: Rng, style: Style) -> list[Patch]:
    """A standing lamp that is off."""
    return fittings.floor_lamp(rng, style, None)


@dataclass(frozen=True)
class Theme:
    """A kind of room.

    Attributes:
        first: pieces that come first, each with its chance.
        walls, middle: what else stands at the walls and away from them.
        cover: material of the walls, if not the usual.
    """

    first: tuple[tuple[Builder, float], ...]
    walls: tuple[Builder, ...]
    middle: tuple[Builder, ...]
    cover: Callable[[Rng], Material] | None = None


BOXES = (storage.shelf, storage.shelf, storage.cupboard, storage.cupboard)
SMALL_FREE = (seats.chair, seats.stool, tables.table, house_plant, house_plant, dark_lamp)

THEMES: dict[str, Theme] = {
    "living": Theme(
        (
            (seats.sofa, 0.9),
            (tables.tv_board, 0.7),
            (tables.table, 0.8),
            (seats.armchair, 0.5),
            (extras.dining_group, 0.3),
        ),
        (*BOXES, seats.sofa, seats.armchair, tables.desk, fittings.radiator, extras.podium),
        SMALL_FREE,
    ),
    "bedroom": Theme(
        ((seats.bed, 0.95), (storage.cupboard, 0.8), (storage.cupboard, 0.6), (extras.workplace, 0.3)),
        (*BOXES, seats.armchair, fittings.radiator, extras.ladder),
        (*SMALL_FREE, extras.laundry_rack),
    ),
    "kitchen": Theme(
        (
            (kitchen.kitchen_run, 1.0),
            (kitchen.kitchen_run, 0.5),
            (storage.fridge, 0.7),
            (extras.dining_group, 0.7),
            (kitchen.island, 0.3),
        ),
        (storage.cupboard, storage.shelf, storage.fridge, fittings.radiator, bathroom.washer, kitchen.kitchen_run),
        (seats.stool, seats.chair, tables.table, house_plant),
    ),
    "office": Theme(
        (
            (extras.workplace, 1.0),
            (extras.workplace, 0.7),
            (extras.workplace, 0.4),
            (storage.shelf, 0.7),
            (tables.table, 0.3),
        ),
        (*BOXES, extras.workplace, tables.desk, fittings.radiator),
        (seats.office_chair, seats.chair, house_plant, tables.table, extras.dining_group),
    ),
    "bath": Theme(
        ((bathroom.bathtub, 0.6), (bathroom.toilet, 0.8), (bathroom.washbasin, 0.95), (bathroom.shower, 0.5)),
        (bathroom.washer, bathroom.towels, bathroom.towels, storage.cupboard, fittings.radiator, bathroom.washbasin),
        (seats.stool, house_plant, extras.laundry_rack),
        materials.tile,
    ),
    "store": Theme(
        ((storage.shelf, 0.9), (storage.shelf, 0.7), (extras.heap, 0.9), (extras.heap, 0.7)),
        (*BOXES, extras.ladder, extras.podium, extras.steps, bathroom.washer),
        (extras.heap, extras.heap, extras.laundry_rack, tables.table, seats.chair),
    ),
    "hall": Theme(
        ((storage.cupboard, 0.4), (extras.steps, 0.25)),
        (storage.cupboard, storage.shelf, fittings.radiator, extras.podium, extras.steps),
        (house_plant, seats.chair, extras.heap),
    ),
    "anything": Theme(
        (),
        (
            *BOXES,
            seats.sofa,
            seats.bed,
            seats.armchair,
            tables.desk,
            tables.tv_board,
            storage.fridge,
            kitchen.kitchen_run,
            bathroom.washbasin,
            bathroom.bathtub,
            bathroom.towels,
            bathroom.washer,
            extras.workplace,
            extras.steps,
            extras.podium,
            extras.ladder,
            fittings.radiator,
        ),
        (*SMALL_FREE, seats.office_chair, extras.heap, extras.dining_group, kitchen.island, extras.laundry_rack),
    ),
}
CHANCES = {
    "living": 0.22,
    "bedroom": 0.13,
    "kitchen": 0.17,
    "office": 0.13,
    "bath": 0.07,
    "store": 0.06,
    "hall": 0.08,
    "anything": 0.14,
}


def random_theme(rng: Rng) -> Theme:
    """Draws a kind of room."""
    return THEMES[str(rng.choice(list(CHANCES), p=list(CHANCES.values())))]
