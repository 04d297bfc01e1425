"""Floor plans of rooms whose dimensions are known."""

from __future__ import annotations

import io
import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import trimesh

from room2dgs.errors import InputError
from room2dgs.plan.dxf import dxf
from room2dgs.plan.floor_plan import as_json, floor_plan, sentences
from room2dgs.plan.label import LETTER, room_label
from room2dgs.plan.outline import Outline, Side
from room2dgs.plan.surface import level_surface
from room2dgs.plan.svg import svg

Z_UP = np.array([0, 0, 1.0])
SPACING = 0.05


def surface(corners: list, normal_to) -> trimesh.Trimesh:
    """A rectangle in faces of 5 cm, wound so that it faces the point `normal_to`."""
    a, b, d = (np.array(corner, float) for corner in corners)
    n, m = (max(1, round(np.linalg.norm(side) / SPACING)) for side in (b - a, d - a))
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    vertices = a + u.reshape(-1, 1) * (b - a) + v.reshape(-1, 1) * (d - a)
    index = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    p, q, r, s = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    facing = np.cross(b - a, d - a) @ (np.array(normal_to, float) - a) > 0
    return trimesh.Trimesh(vertices, faces if facing else faces[:, ::-1], process=False)


def room_of(outline: list, height: float, tiles: list, ceiling: bool = True) -> trimesh.Trimesh:
    """Walls over an outline (counter-clockwise), floor and ceiling of rectangles (x0, y0, x1, y1)."""
    parts = []
    for (x0, y0), (x1, y1) in zip(outline, [*outline[1:], outline[0]], strict=True):
        left = (x0 - (y1 - y0), y0 + (x1 - x0), 0)
        parts.append(surface([(x0, y0, 0), (x1, y1, 0), (x0, y0, height)], left))
    for x0, y0, x1, y1 in tiles:
        parts.append(surface([(x0, y0, 0), (x1, y0, 0), (x0, y1, 0)], (x0, y0, 1)))
        if ceiling:
            parts.append(surface([(x0, y0, height), (x1, y0, height), (x0, y1, height)], (x0, y0, 0)))
    return trimesh.util.concatenate(parts)


def box(low, high) -> trimesh.Trimesh:
    """Furniture: seen from outside."""
    made = trimesh.creation.box(bounds=[low, high])
    return made.subdivide_to_size(0.15)


@pytest.fixture(scope="module")
def furnished() -> trimesh.Trimesh:
    """4.2 x 3.1 x 2.55 m, with a table, a wardrobe and a rough surface (3 mm)."""
    empty = room_of([(0, 0), (4.2, 0), (4.2, 3.1), (0, 3.1)], 2.55, [(0, 0, 4.2, 3.1)])
    whole = trimesh.util.concatenate([empty, box((1, 1, 0.0), (2.5, 2, 0.75)), box((3.5, 0, 0), (4.2, 1.2, 1.9))])
    rough = np.random.default_rng(0).normal(scale=0.003, size=whole.vertices.shape)
    return trimesh.Trimesh(whole.vertices + rough, whole.faces, process=False)


def test_dimensions_of_a_furnished_room_to_a_few_millimetres(furnished):
    plan = floor_plan(furnished, Z_UP)
    (room,) = plan.rooms
    assert sorted(side.length_m for side in room.sides) == pytest.approx([3.1, 3.1, 4.2, 4.2], abs=0.003)
    assert plan.height_m == pytest.approx(2.55, abs=0.003)
    assert room.area_m2 == pytest.approx(4.2 * 3.1, abs=0.02)
    assert [one.name for one in plan.planes] == ["floor", "ceiling", "wall_1", "wall_2", "wall_3", "wall_4"]
    assert plan.floor.spread_m < 0.006


def test_any_world_and_any_heading_give_the_same_plan(furnished):
    up = np.array([0.36, -0.48, 0.8])
    turn = trimesh.geometry.align_vectors(Z_UP, up) @ trimesh.transformations.rotation_matrix(0.4, Z_UP)
    turned = trimesh.Trimesh(furnished.vertices @ turn[:3, :3].T + (5, -7, 2), furnished.faces, process=False)
    plan = floor_plan(turned, up)
    assert sorted(side.length_m for side in plan.rooms[0].sides) == pytest.approx([3.1, 3.1, 4.2, 4.2], abs=0.003)
    floor = as_json(plan)["planes"][0]
    np.testing.assert_allclose(floor["normal"], up, atol=1e-9)
    assert floor["offset_m"] == pytest.approx(up @ (5, -7, 2), abs=0.003)


def attic(knee: float, ridge: float, wardrobe: bool) -> trimesh.Trimesh:
    """4 x 3 m under a gable roof whose ridge runs along x."""
    inside, high = (2.0, 1.5, 0.8), (0.0, 1.5, ridge)
    parts = [surface([(0, 0, 0), (4, 0, 0), (0, 3, 0)], (0, 0, 1))]
    for x in (0.0, 4.0):
        gable = surface([(x, 0, 0), (x, 3, 0), (x, 0, ridge)], inside)
        middle = gable.triangles_center
        gable.update_faces(middle[:, 2] < ridge - (ridge - knee) * np.abs(middle[:, 1] - 1.5) / 1.5)
        parts.append(gable)
    for y in (0.0, 3.0):
        parts.append(surface([(0, y, 0), (4, y, 0), (0, y, knee)], inside))
        parts.append(surface([(0, y, knee), (4, y, knee), high], inside))
    if wardrobe:
        parts.append(box((1.0, 2.0, 0), (1.8, 2.9, 0.7)))
    return trimesh.util.concatenate(parts)


@pytest.mark.parametrize(("knee", "ridge"), [(1.0, 2.5), (1.3, 2.8)])
@pytest.mark.parametrize("wardrobe", [False, True])
def test_walls_below_a_slanted_ceiling_are_walls_and_what_stands_there_is_none(knee, ridge, wardrobe):
    plan = floor_plan(attic(knee, ridge, wardrobe), Z_UP)
    assert plan.ceiling is None and "no level ceiling was seen" in sentences(plan)[0]
    (room,) = plan.rooms
    assert sorted(side.length_m for side in room.sides) == pytest.approx([3, 3, 4, 4], abs=0.01)
    assert len(plan.walls) == 4 and all(side.wall is not None for side in room.sides)


@pytest.mark.parametrize(("wide", "rooms"), [(0.9, [12.0, 7.5]), (1.8, [19.5])])
def test_a_wall_with_a_door_parts_two_rooms_and_one_with_a_wide_gap_to_the_ceiling_does_not(wide, rooms):
    """Only the larger room saw the wall between them: the line of its other walls goes on beyond them too."""
    left, right, high = 2.0 - wide / 2, 2.0 + wide / 2, 2.5
    inside, beyond = (2.0, 1.5, 1.0), (2.0, -1.5, 1.0)
    around = [[(4, 0), (4, 3)], [(4, 3), (0, 3)], [(0, 3), (0, 0)], [(0, 0), (left, 0)], [(right, 0), (4, 0)]]
    other = [[(0.8, 0), (0.8, -3)], [(0.8, -3), (3.3, -3)], [(3.3, -3), (3.3, 0)]]
    parts = [
        surface([(*start, 0), (*end, 0), (*start, high)], towards)
        for sides, towards in ((around, inside), (other, beyond))
        for start, end in sides
    ]
    if wide < 1:
        parts.append(surface([(left, 0, 2.0), (right, 0, 2.0), (left, 0, high)], inside))
    for x0, y0, x1, y1 in ((0, 0, 4, 3), (0.8, -3, 3.3, 0)):
        parts.append(surface([(x0, y0, 0), (x1, y0, 0), (x0, y1, 0)], (x0, y0, 1)))
        parts.append(surface([(x0, y0, high), (x1, y0, high), (x0, y1, high)], (x0, y0, 0)))
    plan = floor_plan(trimesh.util.concatenate(parts), Z_UP)
    assert [room.area_m2 for room in plan.rooms] == pytest.approx(rooms, abs=0.02)


def test_a_room_with_a_corner_cut_out():
    outline = [(0, 0), (5, 0), (5, 2), (3, 2), (3, 4), (0, 4)]
    mesh = room_of(outline, 2.6, [(0, 0, 5, 2), (0, 2, 3, 4)])
    (room,) = floor_plan(mesh, Z_UP).rooms
    assert sorted(round(side.length_m, 4) for side in room.sides) == [2, 2, 2, 3, 4, 5]
    assert room.area_m2 == pytest.approx(16, abs=1e-3)
    assert all(side.wall is not None for side in room.sides)


def test_a_curtain_is_no_wall_and_floor_that_reaches_under_the_walls_no_notch():
    """Curtains 10 cm before a wall, up to 2.2 of 2.6 m; the floor reaches 3 cm beyond the walls, as in a rough mesh."""
    empty = room_of([(0, 0), (4.5, 0), (4.5, 3.5), (0, 3.5)], 2.6, [(-0.03, -0.03, 4.53, 3.53)])
    curtains = [surface([(4.4, y, 0), (4.4, y + 0.5, 0), (4.4, y, 2.2)], (0, y, 0)) for y in (0.7, 2.2)]
    (room,) = floor_plan(trimesh.util.concatenate([empty, *curtains]), Z_UP).rooms
    assert sorted(side.length_m for side in room.sides) == pytest.approx([3.5, 3.5, 4.5, 4.5], abs=0.003)
    assert all(side.wall is not None for side in room.sides)


@pytest.mark.parametrize(("seen_above", "width"), [(False, 4.0), (True, 4.6), (True, 4.8)])
def test_a_front_that_is_not_seen_up_to_the_ceiling_is_a_wall_where_nothing_was_seen_behind_it(seen_above, width):
    """The wall x = 4 was filmed up to 1.7 m of 2.5; or it is a row of wardrobes over which one sees the wall behind."""
    outline = [(0, 0), (width, 0), (width, 3), (0, 3)]
    middle = (2, 1.5, 1)
    parts = [room_of(outline, 2.5, [(0, 0, 3.8, 3)], ceiling=False)]
    walls = parts[0].triangles_center
    parts[0].update_faces((walls[:, 0] < 3.9) | (seen_above & (walls[:, 2] > 1.7)))
    parts.append(surface([(4, 0, 0), (4, 3, 0), (4, 0, 1.7)], middle))
    parts.append(surface([(0, 0, 2.5), (3.2, 0, 2.5), (0, 3, 2.5)], middle))
    if seen_above:
        parts.append(surface([(3.2, 0, 2.5), (width, 0, 2.5), (3.2, 3, 2.5)], middle))
    (room,) = floor_plan(trimesh.util.concatenate(parts), Z_UP).rooms
    assert sorted(side.length_m for side in room.sides) == pytest.approx([3, 3, width, width], abs=0.01)
    assert all(side.wall is not None for side in room.sides)


def test_walls_within_6_degrees_of_square_are_square():
    for degrees, turned in ((5, 0), (8, 1)):
        lean = 3 * np.tan(np.radians(degrees))
        outline = [(0, 0), (4, 0), (4 - lean, 3), (0, 3)]
        plan = floor_plan(room_of(outline, 2.5, [(0, 0, 4, 3)]), Z_UP)
        assert sum(bool(np.abs(wall.normal).max() < 0.999) for wall in plan.walls) == turned


def test_a_chimney_before_a_wall_stays():
    outline = [(0, 0), (4.5, 0), (4.5, 1), (4.2, 1), (4.2, 2.4), (4.5, 2.4), (4.5, 3.5), (0, 3.5)]
    tiles = [(0, 0, 4.2, 3.5), (4.2, 0, 4.5, 1), (4.2, 2.4, 4.5, 3.5)]
    (room,) = floor_plan(room_of(outline, 2.6, tiles), Z_UP).rooms
    assert len(room.sides) == 8 and room.area_m2 == pytest.approx(4.5 * 3.5 - 0.3 * 1.4, abs=1e-3)


def test_a_slanted_wall_is_no_right_angle():
    mesh = room_of([(0, 0), (4, 0), (4, 2), (2.5, 3.5), (0, 3.5)], 2.6, [(0, 0, 4, 2), (0, 2, 2.5, 3.5)])
    mesh = trimesh.util.concatenate([mesh, *_half_tile()])
    (room,) = floor_plan(mesh, Z_UP).rooms
    assert sorted(side.length_m for side in room.sides) == pytest.approx([2, 1.5 * 2**0.5, 2.5, 3.5, 4], abs=0.005)


def _half_tile() -> list[trimesh.Trimesh]:
    corners = [(2.5, 2.0, 0.0), (4.0, 2.0, 0.0), (2.5, 3.5, 0.0)]
    triangle = trimesh.Trimesh(corners, [[0, 1, 2]], process=False).subdivide_to_size(0.05)
    roof = trimesh.Trimesh(triangle.vertices + np.array([0, 0, 2.6]), triangle.faces[:, ::-1], process=False)
    return [triangle, roof]


def test_two_rooms_with_a_wall_between():
    left = room_of([(0, 0), (3, 0), (3, 3), (0, 3)], 2.5, [(0, 0, 3, 3)])
    right = room_of([(3.12, 0), (5.12, 0), (5.12, 3), (3.12, 3)], 2.5, [(3.12, 0, 5.12, 3)])
    plan = floor_plan(trimesh.util.concatenate([left, right]), Z_UP)
    assert [round(room.area_m2, 2) for room in plan.rooms] == [9, 6]


def test_what_was_not_seen_is_open_and_has_no_height():
    mesh = room_of([(0, 0), (4, 0), (4, 3), (0, 3)], 2.5, [(0, 0, 4, 3)], ceiling=False)
    east = (mesh.triangles_center[:, 0] > 3.999) & (mesh.triangles_center[:, 2] > 0)
    plan = floor_plan(trimesh.Trimesh(mesh.vertices, mesh.faces[~east], process=False), Z_UP)
    assert plan.height_m is None and plan.ceiling is None
    assert sorted(plan.wall_name(side) for side in plan.rooms[0].sides) == ["open", "wall_1", "wall_2", "wall_3"]
    assert "1 of 4 sides have no wall" in sentences(plan)[0]


def test_a_mesh_without_a_floor_is_refused():
    wall = surface([(0, 0, 0), (3, 0, 0), (0, 0, 2)], (0, 1, 0))
    with pytest.raises(InputError, match="no floor"):
        floor_plan(wall, Z_UP)


def test_svg_and_json_say_the_lengths(furnished):
    plan = floor_plan(furnished, Z_UP)
    texts = [item.text for item in ET.fromstring(svg(plan, "a <room>\x1b")).iter("{http://www.w3.org/2000/svg}text")]
    assert texts.count("4.20 m") == 2 and texts.count("3.10 m") == 2 and "height 2.55 m" in texts
    told = json.loads(json.dumps(as_json(plan)))
    assert {side["wall"] for side in told["rooms"][0]["sides"]} == {"wall_1", "wall_2", "wall_3", "wall_4"}


def test_dxf_is_read_back_in_metres(furnished):
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.read(io.StringIO(dxf(floor_plan(furnished, Z_UP))))
    assert document.header["$INSUNITS"] == 6
    assert not document.audit().errors
    walls = document.modelspace().query('LINE[layer=="WALLS"]')
    lengths = sorted((line.dxf.end - line.dxf.start).magnitude for line in walls)
    assert lengths == pytest.approx([3.1, 3.1, 4.2, 4.2], abs=0.003)
    measured = sorted(one.get_measurement() for one in document.modelspace().query("DIMENSION"))
    assert measured == pytest.approx(lengths, abs=1e-6)


def test_dxf_dimensions_stand_outside_and_are_read_from_below_or_from_the_right(furnished):
    ezdxf = pytest.importorskip("ezdxf")
    plan = floor_plan(furnished, Z_UP)
    document = ezdxf.read(io.StringIO(dxf(plan)))
    corners = np.array([side.start for side in plan.rooms[0].sides])
    low, high = corners.min(axis=0), corners.max(axis=0)
    texts = [
        text
        for one in document.modelspace().query("DIMENSION")
        for text in document.blocks.get(one.dxf.geometry).query("MTEXT")
    ]
    assert sorted(text.get_rotation() % 360 for text in texts) == pytest.approx([0, 0, 90, 90], abs=0.1)
    for text in texts:
        place = np.array(text.dxf.insert)[:2]
        assert (place < low).any() or (place > high).any()


@pytest.mark.parametrize("sides", [(0.8, 6.0), (3.0, 3.0), (0.5, 0.5)])
def test_a_rooms_text_stays_within_its_walls(sides):
    width, length = sides
    corners = np.array([(0, 0), (width, 0), (width, length), (0, length)], float)
    walls = [Side(one, other, 0) for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    lines = ["room 1: 12.34 m²", "height 2.550 m"]
    label = room_label(Outline(tuple(walls), (), width * length), lines, 0.14)
    half = LETTER * max(map(len, lines)) * label.size_m / 2
    for at in label.lines:
        assert half <= at[0] <= width - half and label.size_m / 2 <= at[1] <= length - label.size_m / 2
    assert label.lines[0][1] > label.lines[1][1]
    assert (label.size_m == 0.14) == (width == 3.0)


def test_a_text_is_not_put_where_an_angular_room_has_no_floor():
    corners = np.array([(0, 0), (4, 0), (4, 4), (3, 4), (3, 1), (0, 1)], float)
    walls = [Side(one, other, 0) for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    x, y = room_label(Outline(tuple(walls), (), 7.0), ["room 1"], 0.14).lines[0]
    assert x > 3 or y < 1


def test_a_rough_wall_is_seen_whole():
    """Faces of 1 cm, uneven by 2.5 mm: many lean by more than any wall may, together they do not."""
    made = surface([(0, 0, 0), (3, 0, 0), (0, 0, 2.5)], (0, 1, 0)).subdivide().subdivide()
    rough = np.random.default_rng(1).normal(scale=0.0025, size=made.vertices.shape)
    made = trimesh.Trimesh(made.vertices + rough, made.faces, process=False)
    leaning = np.abs(made.face_normals[:, 2]) > np.sin(np.radians(12))
    assert made.area_faces[leaning].sum() > 0.3 * made.area  # of the faces by themselves
    found = level_surface(made, Z_UP)
    assert found.area[found.upright].sum() > 0.97 * made.area


def test_a_closed_door_before_a_wall_does_not_move_it():
    """4 cm before a wall of which more is hidden than seen; the median of both would be at the door."""
    empty = room_of([(0, 0), (4, 0), (4, 3), (0, 3)], 2.6, [(0, 0, 4, 3)])
    middle = empty.triangles_center
    hidden = (middle[:, 0] > 3.99) & (middle[:, 1] > 0.9) & (middle[:, 1] < 2.7) & (middle[:, 2] < 2.1)
    seen = trimesh.Trimesh(empty.vertices, empty.faces[~hidden], process=False)
    door = surface([(3.96, 0.9, 0), (3.96, 2.7, 0), (3.96, 0.9, 2.1)], (0, 1, 1))
    whole = trimesh.util.concatenate([seen, door])
    rough = np.random.default_rng(1).normal(scale=0.004, size=whole.vertices.shape)
    plan = floor_plan(trimesh.Trimesh(whole.vertices + rough, whole.faces, process=False), Z_UP)
    assert sorted(side.length_m for side in plan.rooms[0].sides) == pytest.approx([3, 3, 4, 4], abs=0.004)


def test_planes_lie_where_their_faces_are_surest():
    """Six tenths of a wall, floor and ceiling stand 15 mm too far in and are known to 20 mm, the rest to 3 mm."""
    made = room_of([(0, 0), (4.0, 0), (4.0, 3.0), (0, 3.0)], 2.5, [(0, 0, 4.0, 3.0)])
    unsure = made.vertices[:, 0] < 2.4
    inward = made.vertex_normals
    made.vertices[unsure] += 0.015 * np.round(inward[unsure])
    plain = floor_plan(made.copy(), Z_UP, np.array([[2.0, 1.5, 1.5]]))
    made.vertex_attributes["expected_error"] = np.where(unsure, 0.02, 0.003).astype(np.float32)
    found = floor_plan(made, Z_UP, np.array([[2.0, 1.5, 1.5]]))
    assert plain.height_m == pytest.approx(2.47, abs=1e-3) and found.height_m == pytest.approx(2.5, abs=1e-3)
    across = [sorted(side.length_m for side in one.rooms[0].sides) for one in (plain, found)]
    assert across[0][0] == pytest.approx(2.97, abs=2e-3) and across[1][0] == pytest.approx(3.0, abs=2e-3)


def test_where_one_stood_is_inside_though_neither_floor_nor_ceiling_was_seen():
    """A corridor with strips of floor along its walls; without the cameras there is no room."""
    strips = [(0, 0, 0.3, 6), (1.4, 0, 1.7, 6)]
    walls = room_of([(0, 0), (1.7, 0), (1.7, 6), (0, 6)], 2.6, strips, ceiling=False)
    with pytest.raises(InputError, match="no room"):
        floor_plan(walls, Z_UP)
    stood = np.column_stack([np.full(20, 0.9), np.linspace(1, 5, 20), np.full(20, 1.5)])
    (room,) = floor_plan(walls, Z_UP, stood).rooms
    assert room.area_m2 == pytest.approx(1.7 * 6, abs=0.01)
    outside = np.column_stack([np.full(20, 9.0), np.linspace(1, 5, 20), np.full(20, 1.5)])
    with pytest.raises(InputError, match="no room"):
        floor_plan(walls, Z_UP, outside)
