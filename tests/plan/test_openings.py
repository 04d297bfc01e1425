"""Openings of walls that rays of known views look through."""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import trimesh

from room2dgs.bench.plan import counted, scores
from room2dgs.bench.plan_truth import read_plan_truth
from room2dgs.errors import InputError
from room2dgs.plan.dxf import dxf
from room2dgs.plan.floor_plan import FloorPlan, as_json, floor_plan, sentences
from room2dgs.plan.openings import with_openings
from room2dgs.plan.sight import Rays
from room2dgs.plan.svg import svg
from room2dgs.plan.wall_picture import Seen

WIDTH, DEPTH, HEIGHT = 4.0, 3.0, 2.5
FAR = 3.0  # metres, of the room behind a door


def empty_room() -> trimesh.Trimesh:
    box = trimesh.creation.box(bounds=[(0, 0, 0), (WIDTH, DEPTH, HEIGHT)]).subdivide_to_size(0.2)
    return trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)


def looked(holes, leaf=None, seed: int = 0, count: int = 120_000) -> Rays:
    """Rays from six cameras that end on the walls, or behind the holes of the wall y = 0.

    Args:
        holes: (x0, x1, z0, z1, depth) each.
        leaf: (x0, x1, z0, z1) of something 4.5 cm before the wall.
    """
    rng = np.random.default_rng(seed)
    cameras = np.array([[x, y, 1.4] for x in (0.8, 2.0, 3.2) for y in (1.2, 2.2)])
    view = rng.integers(len(cameras), size=count)
    origin = cameras[view]
    target = np.column_stack([rng.uniform(0, WIDTH, count), np.zeros(count), rng.uniform(0, HEIGHT, count)])
    direction = target - origin
    end = target.copy()
    for *area, depth in holes:
        inside = within(target, area)
        end[inside] = (target + direction * (depth / -direction[:, 1])[:, None])[inside]
    if leaf is not None:
        before = within(target, leaf)
        end[before] = (target - direction * (0.045 / -direction[:, 1])[:, None])[before]
    noise = rng.normal(scale=0.005, size=count)[:, None] * direction / np.linalg.norm(direction, axis=1)[:, None]
    return Rays(origin, end + noise, np.full(count, 0.01), view)


def within(places: np.ndarray, area) -> np.ndarray:
    x0, x1, z0, z1 = area
    return (places[:, 0] > x0) & (places[:, 0] < x1) & (places[:, 2] > z0) & (places[:, 2] < z1)


def painted(plan: FloorPlan, *areas):
    """Photos of a grey room whose wall y = 0 has (x0, x1, z0, z1, grey) rectangles."""

    def look(points: np.ndarray, normal: np.ndarray) -> Seen:
        world = points @ plan.level_from_world
        grey = np.full(len(points), 0.5)
        for *area, level in areas:
            grey[within(world, area) & (np.abs(world[:, 1]) < 0.05)] = level
        return Seen(np.repeat(grey[:, None], 3, axis=1), np.ones(len(points), bool))

    return look


@pytest.fixture(scope="module")
def bare() -> FloorPlan:
    return floor_plan(empty_room(), np.array([0, 0, 1.0]))


def opened(plan: FloorPlan, rays: Rays, *areas) -> FloorPlan:
    return with_openings(plan, rays.turned(plan.level_from_world), painted(plan, *areas), 0.0)


def place(plan: FloorPlan, one) -> np.ndarray:
    """x at both ends, in the world, from left to right."""
    side = plan.rooms[one.room].sides[one.side]
    along = (side.end - side.start) / side.length_m
    ends = np.stack([side.start + at * along for at in (one.start_m, one.end_m)])
    return np.sort((np.column_stack([ends, [0, 0]]) @ plan.level_from_world)[:, 0])


HOLES = [(0.5, 1.4, 0, 2.05, FAR), (2.0, 3.0, 0.9, 2.1, FAR), (3.2, 3.75, 1.0, 1.8, 0.2)]
SHOWN = [(0.5, 1.4, 0, 2.05, 0.2), (2.0, 3.0, 0.9, 2.1, 0.8), (3.2, 3.75, 1.0, 1.8, 0.3)]


def test_a_door_a_window_and_a_niche_are_told_apart_and_measured(bare):
    plan = opened(bare, looked(HOLES), *SHOWN)
    by_kind = {one.kind: one for one in plan.openings}
    assert sorted(by_kind) == ["door", "niche", "window"] and len(plan.openings) == 3
    for kind, (x0, x1, z0, z1, _) in zip(("door", "window", "niche"), HOLES, strict=True):
        one = by_kind[kind]
        np.testing.assert_allclose(place(plan, one), [x0, x1], atol=0.03)
        assert one.low_m == pytest.approx(z0, abs=0.03) and one.high_m == pytest.approx(z1, abs=0.03)
        assert abs(one.width.value - (x1 - x0)) < 2 * one.width.sigma and 0.02 < one.width.sigma < 0.08
        assert one.probability > 0.8
    assert by_kind["niche"].depth_m == pytest.approx(0.2, abs=0.02) and by_kind["door"].depth_m is None


def test_edges_in_the_photos_tell_where_a_door_ends_that_rays_show_in_part(bare):
    """Depth takes the door for 8 cm narrower on each side, and for 30 cm lower."""
    (one,) = opened(bare, looked([(0.58, 1.32, 0, 1.75, FAR)]), SHOWN[0]).openings
    np.testing.assert_allclose(place(bare, one), [0.5, 1.4], atol=0.03)
    assert one.kind == "door" and one.high_m == pytest.approx(2.05, abs=0.03)


def test_a_wide_one_is_a_passage_and_a_plain_wall_has_none(bare):
    (one,) = opened(bare, looked([(0.5, 2.4, 0, 2.1, FAR)]), (0.5, 2.4, 0, 2.1, 0.3)).openings
    assert one.kind == "passage"
    assert opened(bare, looked([])).openings == ()


def test_what_shows_a_room_and_is_dark_may_be_a_mirror(bare):
    assert opened(bare, looked(HOLES[1:2]), (2.0, 3.0, 0.9, 2.1, 0.4)).openings == ()


def test_a_closed_door_is_a_leaf_in_its_frame(bare):
    """A board of the same depth that hangs on the wall is none."""
    shown = (0.92, 1.88, 0, 2.13, 0.3), (1.0, 1.8, 0, 2.05, 0.7)
    (one,) = opened(bare, looked([], leaf=(0.92, 1.88, 0, 2.13)), *shown).openings
    assert one.kind == "door" and one.closed
    assert one.width.value == pytest.approx(0.8, abs=0.03) and one.high_m == pytest.approx(2.05, abs=0.03)
    assert opened(bare, looked([], leaf=(1.0, 1.9, 0.9, 1.8)), (1.0, 1.9, 0.9, 1.8, 0.7)).openings == ()


def test_a_pane_that_shines_is_a_window_up_to_the_rim_of_its_frame(bare):
    frame, pane = (0.925, 2.275, 0.825, 2.175, 0.3), (1.0, 2.2, 0.9, 2.1, 0.99)
    (one,) = opened(bare, looked([]), frame, pane).openings
    assert one.kind == "window" and one.width.value == pytest.approx(1.35, abs=0.03)
    everywhere = (0, WIDTH, 0, HEIGHT, 0.97)  # an overexposed wall is no window
    assert opened(bare, looked([]), everywhere).openings == ()
    picture = (1.0, 2.2, 0.9, 2.1, 0.2)
    assert opened(bare, looked([]), picture).openings == ()


def test_one_view_alone_is_not_believed(bare):
    rays = looked(HOLES[:1])
    one_view = Rays(*(part[rays.view == 0] for part in rays))
    assert opened(bare, one_view, SHOWN[0]).openings == ()


def test_files_carry_the_openings(bare):
    plan = opened(bare, looked(HOLES[:2]), *SHOWN[:2])
    found = [one for side in as_json(plan)["rooms"][0]["sides"] for one in side.get("openings", [])]
    assert sorted(one["kind"] for one in found) == ["door", "window"]
    drawn = [item.get("class") for item in ET.fromstring(svg(plan, "x")).iter() if item.get("class")]
    assert sorted(drawn) == ["door", "window"]
    assert "DOORS" in dxf(plan) and "WINDOWS" in dxf(plan)
    assert any("door in wall_" in line and "probability" in line for line in sentences(plan))


def test_a_plan_is_scored_by_what_lies_within_10_cm(bare, tmp_path):
    door = {"kind": "door", "wall": 0, "start_m": 0.5, "end_m": 1.4, "low_m": 0.0, "high_m": 2.05, "cut": True}
    outline = [[0, 0], [WIDTH, 0], [WIDTH, DEPTH], [0, DEPTH]]
    room = {"outline": outline, "height_m": HEIGHT, "openings": [door]}
    (tmp_path / "plan_true.json").write_text(json.dumps({"rooms": [room], "tops": []}))
    truth = read_plan_truth(tmp_path)
    right = counted(opened(bare, looked(HOLES[:1]), SHOWN[0]), "x", truth)
    assert all(scores([one])["f"] == pytest.approx(1) for one in right if one.truth)
    moved = opened(bare, looked([(0.7, 1.6, 0, 2.05, FAR)]), (0.7, 1.6, 0, 2.05, 0.2))
    doors = {one.kind: one for one in counted(moved, "x", truth)}["doors"]
    assert (doors.truth, doors.found, doors.said, doors.right) == (1, 0, 1, 0)
    for seen, kind in ((0.5, "doors in part"), (0.0, "doors not seen")):
        counts = {one.kind: one for one in counted(moved, "x", truth, [seen])}
        assert (counts["doors"].truth, counts["doors"].said) == (0, 0)
        assert (counts[kind].truth, counts[kind].found, counts[kind].said, counts[kind].right) == (1, 0, 1, 0)
    nothing = counted(None, "x", truth)
    assert all(one.found == 0 and one.said == 0 for one in nothing)
    longer = [[0, 0], [WIDTH + 0.5, 0], [WIDTH + 0.5, DEPTH], [0, DEPTH]]
    (tmp_path / "plan_true.json").write_text(json.dumps({"rooms": [{**room, "outline": longer}], "tops": []}))
    walls = next(one for one in counted(bare, "x", read_plan_truth(tmp_path)) if one.kind == "walls")
    assert walls.truth == pytest.approx(2 * (WIDTH + DEPTH) + 1)
    assert walls.found == pytest.approx(2 * WIDTH + DEPTH, abs=0.25)
    (tmp_path / "plan_true.json").write_text('{"rooms": [{}], "tops": []}')
    with pytest.raises(InputError, match="no truth of a plan"):
        read_plan_truth(tmp_path)
