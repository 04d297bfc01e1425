"""Planes of a room: found in noisy samples, given to the pixels that show them, and what they do for the depth."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from room2dgs.depth.completion import planes as module
from room2dgs.depth.completion.on_planes import flattened, on_planes
from room2dgs.depth.completion.planes import Plane, Samples, find_planes
from room2dgs.depth.completion.restore import with_stereo_detail
from room2dgs.depth.completion.room_planes import samples_of
from room2dgs.geometry.camera import Camera
from room2dgs.stereo.passes import StereoMap

NONE = (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0))
OFF = (1.06, 0.94, 1.09, 0.92)  # of the depth of every third view


def on_plane(rng, normal, offset, count, noise):
    """Samples of a square of 3 m on the plane, seen from 2 m."""
    normal = np.asarray(normal, float) / np.linalg.norm(normal)
    across = np.cross(normal, [0.3, -0.5, 0.8])
    across /= np.linalg.norm(across)
    flat = rng.uniform(-1.5, 1.5, (count, 2)) @ np.stack([across, np.cross(normal, across)])
    xyz = flat + (offset + rng.normal(0, noise, (count, 1))) * normal
    tilted = normal + rng.normal(0, 0.05, (count, 3))
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    return Samples(xyz, tilted, np.full(count, 2.0), np.ones(count), np.full(count, noise))


def together(*parts: Samples) -> Samples:
    return Samples(*(np.concatenate(one) for one in zip(*parts, strict=True)))


def planes_of(samples: Samples) -> list[Plane]:
    return find_planes(samples, right_angles=False)


def test_planes_are_found_through_noise_and_clutter():
    rng = np.random.default_rng(1)
    wall, floor = ((1.0, 0.1, 0.0), -1.2), ((0.0, 0.05, 1.0), 0.1)
    clutter = Samples(
        rng.uniform(-1.5, 1.5, (3000, 3)),
        rng.normal(0, 1, (3000, 3)),
        np.full(3000, 2.0),
        np.ones(3000),
        np.full(3000, 0.3),
    )
    clutter = clutter._replace(normal=clutter.normal / np.linalg.norm(clutter.normal, axis=1, keepdims=True))
    found = planes_of(together(on_plane(rng, *wall, 9000, 0.015), on_plane(rng, *floor, 5000, 0.015), clutter))
    for plane, (normal, offset) in zip(found[:2], (wall, floor), strict=True):
        assert plane.normal @ normal / np.linalg.norm(normal) > 0.9999
        assert plane.offset == pytest.approx(offset, abs=0.003)
    assert sum(plane.share for plane in found[2:]) < 0.1


def test_a_wall_with_some_views_off_is_where_most_have_it():
    rng = np.random.default_rng(2)
    right, off = on_plane(rng, (0, 1, 0), 2.0, 8000, 0.01), on_plane(rng, (0, 1, 0), 2.06, 2500, 0.01)
    assert planes_of(together(right, off))[0].offset == pytest.approx(2.0, abs=0.005)


def test_among_exact_samples_pictures_do_not_draw_their_wall_forward():
    rng = np.random.default_rng(5)
    wall, pictures = on_plane(rng, (1, 0, 0), -1.0, 4000, 0.002), on_plane(rng, (1, 0, 0), -0.975, 2000, 0.002)
    samples = together(wall, pictures)
    (wide, *_), (narrow, *_) = (find_planes(samples, right_angles=False, width=width) for width in (1.0, 0.5))
    assert abs(narrow.offset + 1) < 0.001
    assert wide.offset + 1 > 0.003


def test_a_planes_direction_is_that_of_exact_samples_and_its_place_that_of_all():
    """A floor of which a few samples are exact; most are tilted by 1.5 degrees and 1.5 cm off, and say so."""
    rng = np.random.default_rng(7)
    floor = on_plane(rng, (0, 0, 1), 0.0, 1500, 0.003)
    tilted = on_plane(rng, (np.sin(np.radians(1.5)), 0, np.cos(np.radians(1.5))), 0.015, 10000, 0.01)
    unsure = tilted._replace(error=np.full(10000, 0.06))
    for right_angles in (False, True):
        wall = on_plane(rng, (0, 1, 0.01), -1.0, 2000, 0.003)  # 0.6 degrees off a right angle with the floor
        found = find_planes(together(floor, unsure, wall), right_angles=right_angles)
        plane = max(found, key=lambda one: one.normal[2])
        assert np.degrees(np.arccos(plane.normal[2])) < 0.4
        assert plane.offset > 0.006
    (doubted, *_) = planes_of(together(floor._replace(error=np.full(1500, 0.06)), tilted))
    assert np.degrees(np.arccos(doubted.normal[2])) > 1


def test_both_sides_of_a_thin_wall_are_two_planes():
    rng = np.random.default_rng(3)
    found = planes_of(
        together(on_plane(rng, (0, 1, 0), 2.0, 5000, 0.005), on_plane(rng, (0, -1, 0), -2.02, 4000, 0.005))
    )
    assert sorted(round(float(plane.normal[1])) for plane in found[:2]) == [-1, 1]


@pytest.mark.parametrize("count", [0, 100])
def test_few_samples_have_no_plane(count):
    assert planes_of(on_plane(np.random.default_rng(0), (0, 1, 0), 1.0, count, 0.0)) == []
    assert planes_of(Samples(*NONE)) == []


def test_samples_of_no_weight_do_not_count():
    samples = on_plane(np.random.default_rng(0), (0, 1, 0), 1.0, 1000, 0.0)
    assert planes_of(samples._replace(weight=np.zeros(1000))) == []
    assert planes_of(samples._replace(weight=np.r_[np.ones(300), np.zeros(700)]))[0].share == 1.0


def test_pixels_get_the_plane_that_they_are_near_and_face(camera: Camera):
    """A wall 2 m away and one a metre behind; pixels at 1.9 m that face the camera, and pixels that do not."""
    towards = -camera.forward
    planes = [Plane(towards, float(towards @ (camera.centre + away * camera.forward)), 0.5) for away in (2.0, 3.0)]
    depth = np.full((camera.height, camera.width), 1.9)
    depth[0], depth[1] = 2.9, 0
    normal = np.broadcast_to(towards, (*depth.shape, 3)).copy()
    normal[:, 0] = camera.rotation[0]
    found, trust, _ = on_planes(depth, normal, camera, planes)
    np.testing.assert_allclose(found[2:, 1:], 2.0)
    np.testing.assert_allclose(found[0, 1:], 3.0)
    assert (trust[2:, 1:] > 0.7).all() and (trust[0, 1:] > trust[2, 5]).all()
    assert (trust[1] == 0).all() and (trust[:, 0] == 0).all() and (found[:, 0] == 0).all()


def test_what_almost_lies_on_a_plane_is_moved_onto_it_and_what_stands_before_it_is_not(camera: Camera):
    towards = -camera.forward
    plane = Plane(towards, float(towards @ (camera.centre + 2.0 * camera.forward)), 0.5)
    depth = np.full((camera.height, camera.width), 2.01)
    depth[0], depth[1] = 1.8, 0
    normal = np.broadcast_to(towards, (*depth.shape, 3)).copy()
    normal[:, 0] = camera.rotation[0]
    shift, share = flattened(depth, normal, camera, [plane])
    moved = depth * np.exp(shift)
    assert np.abs(moved[2:, 1:] - 2.0).max() < 0.001
    assert (np.abs(moved[0] - 1.8) < 0.01).all()  # 20 cm before it: 1 / (1 + 5.3^2) of the way
    np.testing.assert_array_equal(moved[:, 0], depth[:, 0])
    assert (share[1] == 0).all() and np.isfinite(shift).all()


def test_samples_know_how_far_off_their_depth_may_be(camera: Camera):
    size = (camera.height, camera.width)
    normal = np.broadcast_to(-camera.forward, (*size, 3))
    part = SimpleNamespace(depth=np.full(size, 2.0), camera=camera)
    samples = samples_of([SimpleNamespace(normal=normal)], [part], [np.full(size, 0.01, np.float32)], None)
    np.testing.assert_allclose(samples.error, 0.02, rtol=1e-6)  # metres of a relative error
    assert len(samples.error) == len(samples.xyz) > 0


def test_stereos_pixels_count_as_far_as_they_may_be_right(camera: Camera):
    depth, error, num_consistent = (np.full((camera.height, camera.width), x, np.float32) for x in (2.0, 0.002, 5))
    stereo = depth.copy()
    stereo[:10] *= 1.002  # the surface's own shape
    stereo[10:20] *= 0.975  # what completion has overruled
    num_consistent[4:6] = 2
    found = with_stereo_detail(depth, error, StereoMap(stereo, num_consistent), camera)
    assert np.abs(found[7:9, 2:-2] - 2.004).max() < 0.0003
    assert np.abs(found[12:18, 2:-2] - 2.0).max() < 0.006
    assert (found[5, 2:-2] == 2).all()  # of too few views
    unsure = with_stereo_detail(depth, 10 * error, StereoMap(stereo, num_consistent), camera)
    assert np.abs(unsure[12:18, 2:-2] - 1.95).max() < 0.006  # where depth may be that far off
    assert (with_stereo_detail(depth, 0 * error, StereoMap(stereo, num_consistent), camera)[:10] - 2 < 3e-4).all()
    stereo[10:20] *= 0.5
    assert (with_stereo_detail(depth, 10 * error, StereoMap(stereo, num_consistent), camera)[12:18] == 2).all()


def test_a_plane_seen_from_behind_is_nobodys(camera: Camera):
    away = camera.forward
    plane = Plane(away, float(away @ (camera.centre + 2 * away)), 0.5)
    depth = np.full((camera.height, camera.width), 2.0)
    _, trust, _ = on_planes(depth, np.broadcast_to(away, (*depth.shape, 3)), camera, [plane])
    assert (trust == 0).all()


@pytest.fixture
def off_by_view(complete_views):
    """How far each view's completed depth is off, its median, if it was off by a factor before."""

    def run(room, factors, planes: bool) -> list[float]:
        frames = room.frames
        depths = {
            frame.name: (depth * factor).astype(np.float32)
            for frame, depth, factor in zip(frames, room.depths, factors, strict=True)
        }
        normals = {
            frame.name: (normal @ frame.camera.rotation).astype(np.float32)
            for frame, normal in zip(frames, room.normals, strict=True)
        }
        points = replace(room.points, weight=np.full(len(room.points), 1e-3, np.float32))  # which views are near alone
        found = complete_views(frames, depths, normals, points, planes=planes, creases=False)
        return [
            float(np.median(np.abs(found[frame.name][0] / depth - 1)))
            for frame, depth in zip(frames, room.depths, strict=True)
        ]

    return run


def test_views_whose_depth_is_off_come_back_to_the_walls_that_the_others_see(box_room, off_by_view):
    room = box_room(count=12, turn=0.15)
    factors = [1.0 if index % 3 else OFF[index // 3] for index in range(12)]
    assert np.median(off_by_view(room, factors, planes=False)[::3]) > 0.05
    assert np.median(off_by_view(room, factors, planes=True)[::3]) < 0.02


def test_walls_come_out_flat_though_every_view_has_them_wavy(box_room, off_by_view):
    room = box_room(count=12, turn=0.15)
    y, x = np.mgrid[0 : room.depths[0].shape[0], 0 : room.depths[0].shape[1]]
    waves = [1 + 0.012 * np.sin(0.35 * x + 2.1 * index) * np.cos(0.31 * y - index) for index in range(12)]
    assert np.median(off_by_view(room, waves, planes=True)) < 0.001


def test_the_candidate_that_most_samples_lie_on_is_taken():
    """A floor of 2 m whose normals are 4 degrees off."""
    rng = np.random.default_rng(0)
    xyz = np.column_stack([rng.uniform(-1, 1, (500, 2)), rng.normal(0, 0.01, 500)])
    normal = np.column_stack([rng.normal(0, np.radians(4), (500, 2)), np.ones(500)])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    width = np.full(500, module.WIDTH_M)
    offset = (normal * xyz).sum(axis=1)
    near = np.abs(xyz @ normal.T - offset) < 2 * width[:, None]
    held = (near & (normal @ normal.T > module.TURN)).sum(axis=0)
    taken, at = module._best_candidate(xyz, normal, width, np.arange(500), np.random.default_rng(0))
    best = int(np.abs(normal - taken).sum(axis=1).argmin())
    assert held[best] == held.max() and at == pytest.approx(offset[best])
