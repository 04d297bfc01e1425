"""Planes meet where photos see them meet, whatever stereo has on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.depth.completion.creases import SeenPlanes, _between, _to_the_edge, creases_of
from room2dgs.depth.completion.plane_refinement import refined_at_creases
from room2dgs.depth.completion.planes import Plane
from room2dgs.geometry.camera import Camera
from tests.conftest import look_at

# A room of 4 x 3 x 2.5 m.
FLOOR, CEILING, WEST, EAST, SOUTH, NORTH = range(6)
NORMALS = np.array([(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)], float)
OFFSETS = np.array([0, -2.5, 0, -4, 0, -3], float)
K = np.array([[110.0, 0, 80], [0, 110, 60], [0, 0, 1]])


def planes_at(offsets: Sequence[float]) -> list[Plane]:
    return [Plane(normal, float(offset), 0.1) for normal, offset in zip(NORMALS, offsets, strict=True)]


def views(count: int = 16) -> list[Camera]:
    """Each looks at the wall before it, down and up by turns, so that floor or ceiling is seen, too."""
    cameras = []
    for index, a in enumerate(np.linspace(0, 6.28, count)):
        eye = np.array([2.0 + 0.7 * np.cos(a), 1.5 + 0.5 * np.sin(a), 1.2 + 0.15 * np.sin(2 * a)])
        way = np.array([np.cos(a), np.sin(a), 0.45 * (-1) ** index])
        cameras.append(Camera(K, 160, 120, np.linalg.inv(look_at(eye, eye + way))))
    return cameras


def shown(camera: Camera, trust: float = 0.0, sampled: Sequence[float] = OFFSETS) -> SeenPlanes:
    """The room as it is, and what stereo has of it: planes with other offsets, of one trust."""
    rays = camera.rays() @ camera.rotation
    facing = rays @ NORMALS.T
    away = OFFSETS - NORMALS @ camera.centre
    z = np.where(facing < 0, away / np.minimum(facing, -1e-9), np.inf)
    which = z.argmin(axis=-1)
    sample = ((np.asarray(sampled) - NORMALS @ camera.centre) / np.minimum(facing, -1e-9))[
        (*np.mgrid[: camera.height, : camera.width], which)
    ]
    return SeenPlanes(camera, np.zeros(which.shape, np.float32), which, sample, np.full(which.shape, trust))


def offsets(planes: Sequence[Plane]) -> np.ndarray:
    return np.array([plane.offset for plane in planes])


def test_a_bare_wall_comes_back_to_where_the_photos_see_its_rim():
    """Stereo is sure of all planes but one, whose few pixels it has where they were assumed, 4 cm before the wall."""
    wrong = OFFSETS.copy()
    wrong[EAST] += 0.04
    seen = []
    for camera in views():
        one = shown(camera, 0.8, wrong)
        seen.append(one._replace(sample_weight=np.where(one.which == EAST, 0.03, one.sample_weight)))
    found = refined_at_creases(planes_at(wrong), seen)
    assert np.abs(offsets(found) - OFFSETS).max() < 0.006
    assert all(one.normal @ normal > 1 - 1e-5 for one, normal in zip(found, NORMALS, strict=True))


def test_a_bare_wall_that_leans_stands_upright_again_and_a_textured_one_stays_as_it_is():
    lean = np.radians(0.4) * np.array([0, 0, 1.0])
    for trust, left in ((0.0, 0.2), (0.95, 0.3)):
        planes = planes_at(OFFSETS)
        normal = NORMALS[EAST] + lean
        normal /= np.linalg.norm(normal)
        planes[EAST] = Plane(normal, float(normal @ [4, 1.5, 1.25]), 0.1)
        seen = [shown(camera, 0.95) for camera in views(80)]
        seen = [one._replace(sample_weight=np.where(one.which == EAST, trust, one.sample_weight)) for one in seen]
        found = refined_at_creases(planes, seen)[EAST]
        angle = np.degrees(np.arccos(min(1.0, found.normal @ NORMALS[EAST])))
        assert angle < left if trust == 0 else angle > left, angle


def test_a_wall_that_stereo_knows_stays_however_often_it_is_asked():
    """A skirting board, which is taken for the floor, lets all creases with it lie one pixel off."""
    seen = [shown(camera, 0.9) for camera in views()]
    raised = [one._replace(which=np.roll(one.which, -1, axis=0)) for one in seen]
    planes = planes_at(OFFSETS)
    for _ in range(6):
        planes = refined_at_creases(planes, raised)
    assert np.abs(offsets(planes) - OFFSETS).max() < 0.015
    unknown = [one._replace(sample_weight=np.zeros(one.sample_weight.shape)) for one in raised]
    for _ in range(6):
        planes = refined_at_creases(planes, unknown)
    assert np.abs(offsets(planes) - OFFSETS).max() > 0.015  # that it was stereo that held it


def test_what_stands_before_a_crease_moves_no_plane():
    """A box whose top, a seventh plane, hides the foot of the wall in most photos."""
    planes = [*planes_at(OFFSETS), Plane(NORMALS[FLOOR], 0.8, 0.1)]
    seen = []
    for index, camera in enumerate(views()):
        one = shown(camera, 0.2)
        rays = camera.rays() @ camera.rotation
        z = (0.8 - camera.centre[2]) / np.minimum(rays[..., 2], -1e-9)
        at = camera.centre + rays * z[..., None]
        top = (rays[..., 2] < 0) & (at[..., 0] > 3.4) & (at[..., 0] < 3.9)
        seen.append(one._replace(which=np.where(top & (index % 4 > 0), 6, one.which)))
    assert any((one.which == 6).any() for one in seen)
    found = refined_at_creases(planes, seen)
    assert np.abs(offsets(found)[:6] - OFFSETS).max() < 0.003


def test_without_creases_planes_stay_to_the_bit():
    planes = planes_at(OFFSETS + 0.01)
    nothing = [one._replace(which=np.full_like(one.which, -1)) for one in map(shown, views(2))]
    assert (
        refined_at_creases(planes, []) == planes
        and refined_at_creases([], []) == []
        and refined_at_creases([], nothing) == []
    )
    seen = [one._replace(which=np.where(one.which == EAST, EAST, -1)) for one in map(shown, views())]
    assert offsets(refined_at_creases(planes, seen)).tolist() == offsets(planes).tolist()


def test_the_order_of_the_planes_is_none_of_its_business():
    wrong = np.add(OFFSETS, [0.01, -0.02, 0.015, -0.01, 0.02, -0.015])
    order = [3, 5, 0, 2, 4, 1]
    seen = [shown(camera, 0.1) for camera in views()]
    place = np.argsort(order)
    turned = [one._replace(which=place[one.which]) for one in seen]
    there = offsets(refined_at_creases([planes_at(wrong)[k] for k in order], turned))
    np.testing.assert_allclose(there, offsets(refined_at_creases(planes_at(wrong), seen))[order], atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(view=st.integers(0, 15), moves=st.lists(st.floats(-0.01, 0.01), min_size=6, max_size=6))
def test_gains_say_how_far_creases_move(view, moves):
    seen = shown(views()[view])
    before = creases_of(seen, NORMALS, OFFSETS)
    after = creases_of(seen, NORMALS, OFFSETS + moves)
    assert len(before.off) == len(after.off) > 0
    np.testing.assert_allclose(
        after.off - before.off, (before.gain * np.array(moves)[before.planes]).sum(axis=1), rtol=0.08, atol=0.02
    )
    assert np.abs(before.off).max() < 1  # exact labels, half a pixel on either side


def test_a_gap_of_one_pixel_is_bridged_and_no_more():
    which = np.full((7, 9), -1)
    which[:3], which[4:] = 2, 5
    pairs, pixel, step = _between(which)
    assert (pairs == [2, 5]).all() and len(pairs) == 9
    assert (pixel[:, 1] == 3.5).all() and pixel[:, 0].tolist() == (np.arange(9) + 0.5).tolist()
    assert (step == [0, 1]).all()
    pairs, pixel, step = _between(which.T)
    assert (pixel[:, 0] == 3.5).all() and (step == [1, 0]).all()
    which[4] = -1
    assert len(_between(which)[0]) == 0


def test_a_crease_goes_to_the_photos_edge_beside_it_and_stays_where_there_is_none():
    grey = np.full((20, 24), 0.3, np.float32)
    grey[:, 12:] = 0.7
    rows = np.arange(6.5, 12.5)
    pixel, across = np.column_stack([np.full(6, 11.4), rows]), np.tile([1.0, 0.0], (6, 1))
    np.testing.assert_allclose(_to_the_edge(grey, pixel, across), 0.6, atol=0.25)
    turned = _to_the_edge(np.ascontiguousarray(grey.T), pixel[:, ::-1], across[:, ::-1])
    np.testing.assert_allclose(turned, _to_the_edge(grey, pixel, across))
    assert np.abs(_to_the_edge(grey, pixel - [6, 0], across)).max() < 1e-6
    assert np.abs(_to_the_edge(grey + 0.001 * (grey > 0.5), pixel - [3.4, 0], across)).max() < 0.1  # too far away


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (2, 1)])
def test_images_of_a_pixel(size):
    assert len(_between(np.zeros(size, np.int64))[0]) == 0


@pytest.mark.parametrize("creases", [False, True])
def test_the_views_depth_of_a_wall_goes_where_its_creases_are(box_room, complete_views, creases):
    """Every view has one wall 4 cm too near; nothing but its creases tells."""
    room = box_room(count=24, turn=0.07)
    depths, walls = {}, {}
    for frame, depth, normal in zip(room.frames, room.depths, room.normals, strict=True):
        east = (normal @ frame.camera.rotation)[..., 0] < -0.5
        away = 4.0 - frame.camera.centre[0]
        depths[frame.name] = np.where(east, depth * (1 - 0.04 / away), depth).astype(np.float32)
        walls[frame.name] = east
    normals = {
        frame.name: (normal @ frame.camera.rotation).astype(np.float32)
        for frame, normal in zip(room.frames, room.normals, strict=True)
    }
    points = replace(room.points, weight=np.full(len(room.points), 1e-3, np.float32))  # which views are near, no more
    found = complete_views(room.frames, depths, normals, points, creases=creases)
    off = np.concatenate(
        [
            ((found[frame.name][0] / depth - 1) * (4.0 - frame.camera.centre[0]))[walls[frame.name]]
            for frame, depth in zip(room.frames, room.depths, strict=True)
        ]
    )
    assert abs(np.median(off)) < 0.02 if creases else np.median(off) < -0.035, np.median(off)
