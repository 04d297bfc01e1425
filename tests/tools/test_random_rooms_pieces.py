"""Every piece of furniture builds for any seed, stands on its floor and does not stick out behind its wall."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.demo_room.geometry import Patch
from room2dgs.tools.random_rooms import clutter, extras, fittings, kitchen, plants, seats, storage, tables
from room2dgs.tools.random_rooms.layout import AT_WALL
from room2dgs.tools.random_rooms.shapes import extent
from room2dgs.tools.random_rooms.style import random_style
from room2dgs.tools.random_rooms.themes import CHANCES, THEMES

WALL_PIECES = sorted(
    {build for theme in THEMES.values() for build in theme.walls} | set(AT_WALL), key=lambda f: f.__name__
)
FREE_PIECES = (
    tables.table,
    seats.chair,
    seats.stool,
    seats.office_chair,
    seats.tub_chair,
    kitchen.island,
    extras.dining_group,
    extras.heap,
    extras.laundry_rack,
    fittings.rug,
    storage.wall_board,
    fittings.picture,
)
SEEDS = range(6)


def named(function) -> str:
    return function.__name__


def check(patches: list[Patch]) -> None:
    """Finite grids, sizes above zero, materials, a piece of furniture's size."""
    assert patches
    for patch in patches:
        assert np.isfinite(patch.grid).all()
        assert patch.grid.ndim == 3
        assert min(patch.size) > 0
        assert hasattr(patch.material, "kind")
    low, high = extent(patches)
    assert (high - low).max() < 5.0


@pytest.mark.parametrize("build", WALL_PIECES, ids=named)
def test_pieces_at_a_wall_stay_before_it_and_on_the_floor(build):
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        patches = build(rng, random_style(rng))
        check(patches)
        low, _ = extent(patches)
        assert low[1] > -0.06
        assert low[2] > -0.03


@pytest.mark.parametrize("build", FREE_PIECES, ids=named)
def test_free_pieces_stand_on_the_floor_around_the_origin(build):
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        patches = build(rng, random_style(rng))
        check(patches)
        low, high = extent(patches)
        assert low[2] > -0.03
        assert (low[:2] < 0.5).all()
        assert (high[:2] > -0.5).all()


@pytest.mark.parametrize("thing", sorted({*clutter.SMALL, *clutter.LARGE, plants.plant}, key=named), ids=named)
def test_small_things_stand_on_their_support(thing):
    for seed in SEEDS:
        patches = thing(np.random.default_rng(seed))
        check(patches)
        assert -0.03 < extent(patches)[0][2] < 0.05


def test_scattered_things_stay_on_their_board():
    for seed in range(10):
        patches = clutter.scatter(np.random.default_rng(seed), (1.0, 2.0), (2.5, 2.6), 0.7, 12)
        low, high = extent(patches)
        assert low[2] > 0.67
        assert (low[:2] > (0.9, 1.8)).all()
        assert (high[:2] < (2.6, 2.8)).all()


def test_themes_name_chances_for_all_kinds_of_rooms():
    assert set(CHANCES) == set(THEMES)
    assert sum(CHANCES.values()) == pytest.approx(1)


def test_a_style_is_drawn_from_its_seed():
    first, second = (random_style(np.random.default_rng(3)) for _ in range(2))
    assert first == second
    assert first != random_style(np.random.default_rng(4))
