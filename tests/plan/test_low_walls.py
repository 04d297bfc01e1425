"""Walls that end far below the ceiling, and what looks a little like them."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
import trimesh

from room2dgs.lengths.plane_sigma import Faces
from room2dgs.lengths.scale import ScaleTrust
from room2dgs.plan.dxf import dxf
from room2dgs.plan.floor_plan import as_json, floor_plan, plan_in_world, sentences
from room2dgs.plan.sigmas import with_sigmas
from room2dgs.plan.svg import svg
from tests.plan.test_floor_plan import Z_UP, room_of

ROOM = [(0, 0), (4, 0), (4, 3), (0, 3)]


def standing(low: tuple, high: tuple, without: str = "") -> trimesh.Trimesh:
    """A box in faces of 5 cm that is seen from outside, in a room of 4 x 3 x 2.5 m."""
    box = trimesh.creation.box(bounds=[low, high]).subdivide_to_size(0.05)
    middle, upright = box.triangles_center, np.abs(box.face_normals[:, 2]) < 0.5
    if without == "foot":
        box.update_faces(~upright | (middle[:, 2] > 0.4) | (box.face_normals[:, 1] < 0))
    return trimesh.util.concatenate([room_of(ROOM, 2.5, [(0, 0, 4, 3)]), box])


@pytest.fixture(scope="module")
def parted():
    """A wall 1.1 m high and 12 cm thick stands out 1.8 m from the wall x = 0."""
    return standing((0.0, 1.4, 0.0), (1.8, 1.52, 1.1))


@pytest.mark.parametrize("turn_deg", [0, 30])
def test_a_low_wall_is_found_with_its_sizes(parted, turn_deg):
    turn = trimesh.transformations.rotation_matrix(np.radians(turn_deg), Z_UP)
    plan = floor_plan(parted.copy().apply_transform(turn), Z_UP)
    (wall,) = plan.low_walls
    assert wall.thick_m == pytest.approx(0.12, abs=0.005) and wall.length_m == pytest.approx(1.8, abs=0.06)
    assert wall.high_m == pytest.approx(1.1, abs=0.08)
    corners = np.column_stack([wall.corners, np.zeros(4)]) @ plan.level_from_world @ turn[:3, :3]
    true = np.array([(0, 1.4), (1.8, 1.4), (1.8, 1.52), (0, 1.52)])
    off = np.linalg.norm(corners[:, None, :2] - true[None], axis=2).min(axis=1)
    assert off.max() < 0.07 and plan.rooms[0].area_m2 == pytest.approx(12, abs=0.05)
    x, y = wall.corners.T
    assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0  # counter-clockwise


@pytest.mark.parametrize(
    ("low", "high", "without"),
    [
        ((1.0, 1.4, 0.0), (2.8, 1.8, 1.1), ""),  # a shelf
        ((1.0, 1.4, 0.4), (2.8, 1.52, 1.2), ""),  # a board that hangs
        ((1.0, 1.4, 0.0), (2.8, 1.6, 1.0), "foot"),  # a sofa's back: on one side its seat begins at 40 cm
        ((1.0, 1.4, 0.0), (1.5, 1.52, 1.1), ""),  # a post
        ((1.0, 1.4, 0.0), (2.8, 1.52, 0.4), ""),  # a step
    ],
)
def test_what_is_no_low_wall(low, high, without):
    assert floor_plan(standing(low, high, without), Z_UP).low_walls == ()


def test_a_column_is_an_island_of_the_room():
    plan = floor_plan(standing((1.8, 1.2, 0.0), (2.3, 1.7, 2.5)), Z_UP)
    (room,) = plan.rooms
    (island,) = room.islands
    assert room.area_m2 == pytest.approx(12 - 0.25, abs=0.02) and len(island) == 4
    assert sorted(side.length_m for side in island) == pytest.approx([0.5] * 4, abs=0.01)


def test_its_thickness_has_a_deviation_and_all_files_have_it(parted):
    faces = Faces(parted.triangles_center, parted.face_normals, parted.area_faces, np.full(len(parted.faces), 0.004))
    plan = with_sigmas(floor_plan(parted, Z_UP), faces, ScaleTrust(True, 0.0, ""))
    moved = plan_in_world(plan, (10.0, 0.0, 5.0))
    (wall,), (there,) = plan.low_walls, moved.low_walls
    shift = (plan.level_from_world @ [10.0, 0, 5])[:2]
    np.testing.assert_allclose(there.corners, wall.corners + shift)
    assert 0.002 < wall.thickness.sigma < 0.012 and "low wall: 0.120 m ± " in "\n".join(sentences(plan))
    (kept,) = json.loads(json.dumps(as_json(plan)))["low_walls"]
    assert kept["thickness"]["value"] == pytest.approx(wall.thick_m) and len(kept["corners"]) == 4
    assert svg(plan, "x").count('class="low-wall"') == 1
    ezdxf = pytest.importorskip("ezdxf")
    (line,) = ezdxf.read(io.StringIO(dxf(plan))).modelspace().query("LWPOLYLINE[layer=='LOW_WALLS']")
    np.testing.assert_allclose([point[:2] for point in line.get_points()], wall.corners, atol=1e-9)


def test_the_ifc_has_it_up_to_its_height(parted):
    ifcopenshell = pytest.importorskip("ifcopenshell")
    from room2dgs.plan.ifc import ifc

    plan = floor_plan(parted, Z_UP)
    walls = ifcopenshell.file.from_string(ifc(plan, "x")).by_type("IfcWall")
    (low,) = [wall for wall in walls if wall.Name == "low wall 1"]
    (solid,) = low.Representation.Representations[0].Items
    assert solid.Depth == pytest.approx(plan.low_walls[0].high_m) and len(walls) == 5
