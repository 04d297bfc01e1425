"""Walls that are flat in parts: stereo's pixels say where the parts lie."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.depth.completion.on_planes import on_planes
from room2dgs.depth.completion.planes import Plane
from room2dgs.depth.completion.relief import REACH_M, Anchors, with_reliefs
from room2dgs.geometry.camera import Camera
from room2dgs.splat import set_threads

WALL = Plane(np.array([0.0, 0.0, -1.0]), -2.0, 0.5)  # z = 2, seen from the origin
VIEWS = 8


def anchors(x, y, height, noise=0.02, count=6000, seed=0) -> Anchors:
    """What eight views see of a rectangle of the wall, `height` before it."""
    rng = np.random.default_rng(seed)
    z = 2.0 - height + rng.normal(0, noise, count)
    xyz = np.column_stack([rng.uniform(*x, count), rng.uniform(*y, count), z])
    normal = np.broadcast_to(WALL.normal, (count, 3))
    return Anchors(xyz, normal, np.full(count, 2.0), np.full(count, 0.9), rng.integers(0, VIEWS, count))


def together(*parts: Anchors) -> Anchors:
    return Anchors(*(np.concatenate(one) for one in zip(*parts, strict=True)))


def heights(plane: Plane, *places) -> list[float]:
    xyz = np.array([[[x, y, 2.0] for x, y in places]])
    return plane.relief.at(xyz)[0].tolist()


def test_a_panel_before_a_wall_keeps_its_place():
    wall, panel = anchors((-2, 0), (-1, 1), 0.0, noise=0.01), anchors((0, 2), (-1, 1), 0.04, noise=0.01, seed=1)
    (found,) = with_reliefs([WALL], together(wall, panel))
    np.testing.assert_allclose(heights(found, (-1.5, 0), (-0.6, 0.5)), 0, atol=0.004)
    np.testing.assert_allclose(heights(found, (1.5, 0), (0.6, 0.5)), 0.04, atol=0.004)
    assert found._replace(relief=None) == WALL


def test_a_blank_part_continues_what_is_beside_it():
    """Between and beyond two textured parts that both lie 3 cm behind the plane."""
    parts = [anchors(x, (-1, 1), -0.03, seed=seed) for seed, x in enumerate([(-2, -1), (0.5, 1.0)])]
    (found,) = with_reliefs([WALL], together(*parts))
    np.testing.assert_allclose(heights(found, (-0.3, 0), (1.6, 0), (-2.4, 0.3)), -0.03, atol=0.004)


def test_noise_leaves_a_wall_flat():
    (found,) = with_reliefs([WALL], anchors((-2, 2), (-1, 1), 0.0, noise=0.025))
    assert np.abs(found.relief.height).max() < 0.006


def test_anchors_on_which_views_do_not_agree_say_little():
    """One part is known to millimetres, the other scatters about 4 cm before the wall."""
    sure = anchors((-2, 0), (-1, 1), 0.0, noise=0.002)
    unsure = anchors((0, 0.4), (-1, 1), 0.03, noise=0.05, count=400, seed=1)
    (found,) = with_reliefs([WALL], together(sure, unsure))
    assert np.abs(heights(found, (0.3, 0.0), (0.3, 0.6))).max() < 0.02


def test_a_cell_that_one_view_sees_has_no_say():
    alone = anchors((-2, 0), (-1, 1), 0.0)._replace(view=np.zeros(6000, int))
    several = anchors((0, 2), (-1, 1), 0.03, seed=1)
    (found,) = with_reliefs([WALL], together(alone, several))
    assert heights(found, (-1.0, 0))[0] > 0.02


def test_furniture_before_the_wall_and_what_faces_elsewhere_do_not_bend_it():
    wall = anchors((-2, 2), (-1, 1), 0.0, count=3000)
    cupboard = anchors((-1, 0), (-1, 1), 0.15, noise=0.005, seed=1)
    side = anchors((0.5, 1.5), (-1, 1), 0.04, noise=0.005, seed=2)._replace(normal=np.full((6000, 3), 3**-0.5))
    (found,) = with_reliefs([WALL], together(wall, cupboard, side))
    assert np.abs(found.relief.height).max() < 0.008


def test_an_anchor_speaks_for_the_plane_that_it_is_nearest_to():
    """A door 5 cm before the wall is a plane of its own: the wall behind it stays where it is."""
    door = Plane(WALL.normal, WALL.offset + 0.05, 0.2)
    parts = anchors((-2, 0), (-1, 1), 0.0, noise=0.008), anchors((0, 2), (-1, 1), 0.05, noise=0.008, seed=1)
    found = with_reliefs([WALL, door], together(*parts))
    for plane in found:
        assert np.abs(plane.relief.height).max() < 0.008


def test_few_anchors_and_none_leave_a_plane_as_it_is():
    few = Anchors(*(part[:40] for part in anchors((-2, 2), (-1, 1), 0.03)))
    none = Anchors(*(part[:0] for part in few))
    assert with_reliefs([WALL], few) == with_reliefs([WALL], none) == [WALL]
    assert with_reliefs([], few) == []


def test_a_narrow_strip_and_one_of_kilometres_have_a_relief():
    strip = anchors((-2, 2), (0, 0.05), 0.02)
    wide = anchors((-2000, 2000), (-1000, 1000), 0.02, count=20000)
    for some in (strip, wide):
        (found,) = with_reliefs([WALL], some)
        assert found.relief.height.size < 12000
        np.testing.assert_allclose(heights(found, (0.5, 0.02)), 0.02, atol=0.02)


def test_same_bits_on_any_number_of_threads():
    some = together(anchors((-2, 0), (-1, 1), 0.0), anchors((0, 2), (-1, 1), 0.03, seed=1))
    found = []
    try:
        for count in (1, 2):
            set_threads(count)
            found.append(with_reliefs([WALL], some)[0].relief.height.tobytes())
    finally:
        set_threads()
    assert found[0] == found[1]


@pytest.mark.parametrize("height", [0.05, -0.05])
def test_pixels_get_the_depth_of_the_bent_plane(height):
    """A camera at the origin that looks at the wall from the side: right where height is, not where the plane is."""
    (plane,) = with_reliefs([WALL], anchors((-4, 4), (-4, 4), height, noise=0.002, count=40000))
    turn = np.radians(30)
    pose = np.eye(4)
    pose[:3, :3] = [[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]]
    camera = Camera(np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]]), 64, 48, pose)
    rays = camera.rays() @ camera.rotation
    exact = (2.0 - height) / rays[..., 2]
    near = np.abs(rays[..., 0] / rays[..., 2]) < 1.8  # where there are anchors
    normal = np.broadcast_to(WALL.normal, (*exact.shape, 3))
    found, trust, _ = on_planes(2.0 / rays[..., 2], normal, camera, [plane])
    np.testing.assert_allclose(found[near], exact[near], atol=0.002)
    assert trust[near].min() > 0.9
    assert abs(height) < REACH_M
