"""The plan of a room at UTM coordinates is that of the room, where it stands."""

from __future__ import annotations

import io

import ezdxf
import numpy as np
import pytest
import trimesh

from room2dgs.plan.dxf import dxf
from room2dgs.plan.floor_plan import FloorPlan, as_json, floor_plan, plan_in_world
from room2dgs.plan.svg import svg

ORIGIN = (500000.0, 5400000.0, 300.0)
SIZE = (4.0, 3.0, 2.5)


@pytest.fixture(scope="module")
def plan() -> FloorPlan:
    """A box seen from inside, turned by 20 degrees."""
    room = trimesh.creation.box(SIZE).subdivide_to_size(0.2)
    room.invert()
    room.apply_transform(trimesh.transformations.rotation_matrix(np.radians(20), (0, 0, 1)))
    return floor_plan(room, np.array([0, 0, 1.0]))


def test_nothing_changes_at_the_origin(plan):
    assert plan_in_world(plan, (0.0, 0.0, 0.0)) is plan


def test_planes_go_through_the_points_of_the_world(plan):
    near, far = as_json(plan), as_json(plan_in_world(plan, ORIGIN))
    for one, other in zip(near["planes"], far["planes"], strict=True):
        normal = np.array(other["normal"])
        point = np.array(one["normal"]) * one["offset_m"] + ORIGIN
        assert normal @ point == pytest.approx(other["offset_m"], abs=1e-6)
        assert (other["low_m"], other["high_m"]) == pytest.approx((one["low_m"], one["high_m"]), abs=1e-6)
    assert far["height_m"] == pytest.approx(SIZE[2], abs=1e-6)
    assert sorted(side["length_m"] for side in far["rooms"][0]["sides"]) == pytest.approx([3, 3, 4, 4], abs=1e-6)
    to_world = np.array(far["level_from_world"]).T
    corner = to_world @ [*far["rooms"][0]["sides"][0]["start"], 0] - ORIGIN
    assert np.hypot(*corner[:2]) == pytest.approx(2.5, abs=1e-6)  # of the middle of the room, 1.5 and 2 m


def test_drawings_keep_millimetres(plan):
    far = plan_in_world(plan, ORIGIN)
    document = ezdxf.read(io.StringIO(dxf(far)))
    lines = [line for line in document.modelspace().query("LINE") if line.dxf.layer in ("WALLS", "OPEN")]
    lengths = sorted((line.dxf.end - line.dxf.start).magnitude for line in lines)
    assert lengths == pytest.approx([3, 3, 4, 4], abs=1e-6)
    middle = np.mean([np.array(line.dxf.start)[:2] for line in lines], axis=0)
    assert np.abs(plan.level_from_world[:2, :2].T @ middle - ORIGIN[:2]).max() < 1e-6
    assert svg(far, "room") == svg(plan, "room")
