"""Solids of the random rooms are closed, face outwards and have their size."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.demo_room.geometry import Material, parallelogram, triangulated
from room2dgs.tools.random_rooms.shapes import (
    bar,
    cushion,
    ellipsoid,
    extent,
    lathe,
    moved,
    prism,
    resting,
    rod,
    rotation,
    rounded_box,
    tube,
    two_sided,
)

PAINT = Material("paint", ((0.5, 0.5, 0.5),))
half_sizes = st.floats(0.01, 1.0)


def solid(patches) -> trimesh.Trimesh:
    """The triangles of patches as one mesh."""
    soup = triangulated(patches)
    return trimesh.Trimesh(soup.vertices.astype(float), soup.triangles.astype(int))


@settings(max_examples=30, deadline=None)
@given(half_sizes, half_sizes, half_sizes, st.floats(0.05, 1.0))
def test_a_rounded_box_is_closed_and_between_its_box_and_its_core(x, y, z, share):
    radius = share * min(x, y, z) * 0.99
    mesh = solid([rounded_box((x, y, z), radius, PAINT)])
    assert mesh.is_watertight
    assert mesh.bounds == pytest.approx(np.array([[-x, -y, -z], [x, y, z]]), abs=1e-6)
    full, core = 8 * x * y * z, 8 * (x - radius) * (y - radius) * (z - radius)
    assert core < mesh.volume <= full
    # flat faces lose nothing, edges and corners what a rod and a ball leave of their boxes
    a, b, c = 2 * (x - radius), 2 * (y - radius), 2 * (z - radius)
    exact = full - (4 - np.pi) * radius**2 * (a + b + c) - (8 - 4 / 3 * np.pi) * radius**3
    assert mesh.volume == pytest.approx(exact, rel=0.12)


def test_volumes_of_round_solids_are_positive_and_near_the_smooth_ones():
    assert solid([ellipsoid((0.3, 0.2, 0.1), PAINT)]).volume == pytest.approx(4 / 3 * np.pi * 0.006, rel=0.04)
    assert solid([rod((1, 2, 3), (1, 2.5, 3), 0.1, PAINT)]).volume == pytest.approx(np.pi * 0.005, rel=0.04)
    straight = np.column_stack([np.linspace(0, 1, 5), np.zeros(5), np.zeros(5)])
    assert solid([tube(straight, 0.1, PAINT, segments=24)]).volume == pytest.approx(np.pi * 0.01, rel=0.02)
    cup = [(0, 0), (0.1, 0), (0.1, 0.2), (0.09, 0.2), (0.09, 0.01), (0, 0.01)]
    walls = np.pi * (0.01 * 0.2 - 0.0081 * 0.19)
    assert solid([lathe(cup, PAINT)]).volume == pytest.approx(walls, rel=0.04)


def test_prisms_and_bars_have_their_exact_volume():
    assert solid(prism([(0, 0), (2, 0), (2, 1), (0, 1)], 0.5, PAINT)).volume == pytest.approx(1.0)
    assert solid(bar((0, 0, 0), (1, 1, 1), 0.1, PAINT, thick=0.2)).volume == pytest.approx(0.02 * np.sqrt(3))


def test_a_cushion_bulges_above_its_box_and_stands_on_the_floor():
    low, high = extent(cushion(0.4, 0.3, 0.1, PAINT))
    assert 0.1 < high[2] < 0.13
    assert -0.03 < low[2] <= 0


@settings(max_examples=30, deadline=None)
@given(st.tuples(*[st.floats(-np.pi, np.pi)] * 3))
def test_resting_puts_the_lowest_point_on_the_floor_and_keeps_the_shape(angles):
    before = bar((0.3, 0, 0), (1, 1, 1), 0.1, PAINT)
    after = resting(before, rotation(*angles))
    low, high = extent(after)
    assert low[2] == pytest.approx(0, abs=1e-9)
    assert low[:2] + high[:2] == pytest.approx([0, 0], abs=1e-9)
    assert solid(after).volume == pytest.approx(solid(before).volume)


def test_a_two_sided_sheet_has_a_back_behind_it():
    sheet = parallelogram((0, 0, 0), (1, 0, 0), (0, 1, 0), PAINT)
    front, back = two_sided(moved([sheet], (0, 0, 5), rotation(0.3))[0], 0.01)
    middle = np.array([0.5])
    (top, up), (under, down) = front.points_at(middle, middle), back.points_at(middle, middle)
    assert up[0] == pytest.approx([0, 0, 1])
    assert down[0] == pytest.approx([0, 0, -1])
    assert top[0, 2] - under[0, 2] == pytest.approx(0.01)
