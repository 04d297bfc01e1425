"""Random rooms are closed, lit, reproducible, and their surfaces face the air."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.demo_room.geometry import Material, triangulated
from room2dgs.demo_room.light import cast
from room2dgs.demo_room.render import ray_scene
from room2dgs.tools.random_rooms import floor_plans, materials, shell
from room2dgs.tools.random_rooms.draft import Draft
from room2dgs.tools.random_rooms.layout import RandomRoom, random_room
from room2dgs.tools.random_rooms.openings import doorway
from room2dgs.tools.random_rooms.shapes import block
from room2dgs.tools.random_rooms.shell import Opening, Space
from room2dgs.tools.random_rooms.style import random_style

pytestmark = pytest.mark.slow

PAINT = Material("paint", ((0.5, 0.5, 0.5),))
SEEDS = range(24)
RAYS = 3000


@pytest.fixture(scope="module")
def rooms() -> list[RandomRoom]:
    return [random_room(np.random.default_rng([11, seed])) for seed in SEEDS]


def rays_from_air(room: RandomRoom, scene, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins in free air at 0.2 m or more from all surfaces, and directions all around."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(*room.bounds, (20000, 3))
    points = points[room.inside(points) & ~room.blocked(points)]
    points = points[scene.compute_distance(points.astype(np.float32)).numpy() > 0.2][:RAYS]
    assert len(points) > 100
    directions = rng.standard_normal(points.shape)
    return points, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def test_nothing_escapes_and_first_hits_face_the_ray(rooms):
    back = total = 0
    for seed, room in enumerate(rooms):
        scene = ray_scene(triangulated(room.patches))
        origins, directions = rays_from_air(room, scene, seed)
        hits = cast(scene, origins, directions)
        assert np.isfinite(hits["t_hit"]).all(), f"a ray left room {seed}"
        behind = np.einsum("ni,ni->n", hits["primitive_normals"], directions) > 0
        assert behind.mean() < 0.02, f"room {seed}"
        back, total = back + behind.sum(), total + len(behind)
    assert back / total < 0.002


def test_every_room_is_lit_and_of_a_sane_size(rooms):
    for room in rooms:
        assert any(patch.material.kind == "emitter" for patch in room.patches)
        assert 50 < len(room.patches) < 7000
        assert sum(2 * (p.grid.shape[0] - 1) * (p.grid.shape[1] - 1) for p in room.patches) < 80000
        assert 2.0 < room.height < 3.7
        assert room.bounds[1, 2] == room.height
        for patch in room.patches:
            assert np.isfinite(patch.grid).all()
            assert min(patch.size) > 0


def test_the_same_seed_gives_the_same_room_and_another_seed_another():
    one, again, other = (random_room(np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert len(one.patches) == len(again.patches)
    for first, second in zip(one.patches, again.patches, strict=True):
        assert (first.grid == second.grid).all()
        assert first.material == second.material
    assert len(other.patches) != len(one.patches) or any(
        a.grid.shape != b.grid.shape or (a.grid != b.grid).any()
        for a, b in zip(one.patches, other.patches, strict=True)
    )


def test_inside_is_the_air_between_floor_walls_and_ceiling(rooms):
    for room in rooms:
        low, high = room.bounds
        middle = np.random.default_rng(0).uniform(low, high, (4000, 3))
        assert room.inside(middle).mean() > 0.3
        assert not room.inside(middle + np.array([0, 0, room.height])).any()
        assert not room.inside(middle - np.array([0, 0, room.height])).any()
        assert not room.inside(middle + (high - low) * (1, 0, 0)).any()


def test_rooms_differ_in_plan_ceiling_fullness_and_lamps(rooms):
    assert len({len(room.patches) for room in rooms}) > 20
    counts = [len(room.patches) for room in rooms]
    assert max(counts) > 4 * min(counts)
    areas = [np.prod((room.bounds[1] - room.bounds[0])[:2]) for room in rooms]
    assert max(areas) > 3 * min(areas)
    lights = {sum(patch.material.kind == "emitter" for patch in room.patches) for room in rooms}
    assert len(lights) > 2
    seen_beyond = [  # through an open doorway
        any(((p.grid < room.bounds[0] - 0.6) | (p.grid > room.bounds[1] + 0.6)).any() for p in room.patches)
        for room in rooms
    ]
    assert 0.2 < np.mean(seen_beyond) < 0.95


def random_space(seed: int) -> Space:
    rng = np.random.default_rng(seed)
    outline = floor_plans.random_outline(rng)
    return Space(outline, floor_plans.random_profile(rng, float(outline[:, 1].max())))


def polygon_area(outline: np.ndarray) -> float:
    x, y = outline.T
    return float(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def surface(patches) -> np.ndarray:
    """(3,) sum of area times normal."""
    soup = triangulated(patches)
    corners = soup.vertices[soup.triangles].astype(float)
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)


@pytest.mark.parametrize("seed", range(40))
def test_a_shell_is_closed_and_its_floor_has_the_area_of_the_plan(seed):
    space = random_space(seed)
    assert polygon_area(space.outline) > 1.0  # counter-clockwise
    patches = shell.space_patches(space, PAINT, PAINT, [PAINT] * len(space.outline))
    floor = [patch for patch in patches if patch.tag == "floor"]
    assert surface(floor) == pytest.approx([0, 0, polygon_area(space.outline)], abs=1e-4)
    assert surface(patches) == pytest.approx([0, 0, 0], abs=1e-3)  # of a closed surface


def test_an_opening_takes_its_area_out_of_the_wall_and_the_recess_closes_it():
    space = Space(np.array([(0, 0), (4, 0), (4, 3), (0, 3)], float), np.array([(-1e3, 2.5), (1e3, 2.5)]))
    hole = Opening(1.0, 2.0, 0.8, 2.0)
    space.openings[0] = [hole]
    wall = shell.wall_patches(space, 0, PAINT)
    assert surface(wall) == pytest.approx([0, 4 * 2.5 - 1.2, 0], abs=1e-5)
    recess = [*shell.reveal(hole, 0.3, PAINT), shell.back_face(hole, 0.3, PAINT, "pane")]
    assert surface(recess) == pytest.approx([0, 1.2, 0], abs=1e-5)
    rest = shell.space_patches(space, PAINT, PAINT, [PAINT] * 4)
    assert surface([*rest, *recess]) == pytest.approx([0, 0, 0], abs=1e-4)


def test_a_skirting_leaves_a_doorway_open():
    space = Space(np.array([(0, 0), (4, 0), (4, 3), (0, 3)], float), np.array([(-1e3, 2.5), (1e3, 2.5)]))
    space.openings[0] = [Opening(1.0, 2.0, 0.0, 2.0), Opening(2.5, 3.5, 1.0, 2.0)]
    spans = {
        (round(p.grid[..., 0].min(), 3), round(p.grid[..., 0].max(), 3))
        for p in shell.skirting(space, 0, 0.1, 0.01, PAINT)
    }
    assert not any(left < 1.5 < right for left, right in spans)
    assert any(left < 3.0 < right for left, right in spans)


def test_the_space_behind_a_doorway_lies_outside_the_room():
    found = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        draft = Draft(random_space(seed), random_style(rng))
        behind = doorway(rng, draft)
        if behind is None:
            continue
        found += 1
        outline = behind.space.outline
        assert polygon_area(outline) > 0.5
        points = np.random.default_rng(seed).uniform(outline.min(axis=0), outline.max(axis=0), (500, 2))
        points = points[behind.space.contains(points)]
        assert not draft.space.contains(points).any()
    assert found > 15


def test_pieces_never_share_the_floor():
    rng = np.random.default_rng(0)
    draft = Draft(random_space(1), random_style(rng))
    free = int(draft.plan.free.sum())
    placed = 0
    for _ in range(40):
        before = draft.plan.free.copy()
        if draft.plan.place(rng, draft, block(0.5, 0.4, 0.8, materials.wood(rng))):
            placed += 1
            assert (before & ~draft.plan.free).sum() > 30  # new cells each time
    assert placed > 2
    assert free - int(draft.plan.free.sum()) >= placed * 30
