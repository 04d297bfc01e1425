"""What one camera observes."""

import numpy as np
import pytest

from room2dgs.eval.culling import NEAR_M, count_views, first_view, sees
from room2dgs.eval.surface import Surface


def test_image_borders_and_near_plane(make):
    camera = make.camera_at((0, 0, 0), (0, 1, 0), pixels=100, half_angle_deg=45)
    edge = 2 * (1 - 1e-9)
    points = np.array(
        [
            [0, 2, 0],
            [edge, 2, 0],
            [2.001, 2, 0],
            [0, 2, -edge],
            [0, 2, 2.001],
            [0, -2, 0],
            [0, 0.04, 0],
            [0, 0.06, 0],
        ]
    )
    assert camera.in_view(points, NEAR_M).tolist() == [True, True, False, True, False, False, False, True]


@pytest.mark.parametrize(
    "y, own_hides, seen",
    [
        (1.0, False, True),  # in front of the true wall
        (1.0, True, True),  # known to be empty, even behind another floater
        (2.015, True, True),  # at the wall, within the tolerance
        (2.03, True, False),  # behind the true wall and behind its own mesh
        (2.03, False, True),  # behind the true wall, but its own mesh's first surface
    ],
)
def test_rules(make, y, own_hides, seen):
    camera = make.camera_at((0, 0, 0), (0, 1, 0))
    truth = make.quad((-3, 2, -3), (6, 0, 0), (0, 0, 6))
    at = make.quad((-0.2, y, -0.2), (0.4, 0, 0), (0, 0, 0.4))
    screen = make.quad((-0.5, 0.5, -0.5), (1, 0, 0), (0, 0, 1))
    own = make.join(at, screen) if own_hides else at
    assert sees(np.array([[0.05, y, 0.02]]), camera, Surface(own), Surface(truth))[0] == seen


def test_views_are_counted_and_the_first_is_named(make):
    cameras = [make.camera_at((x, 0, 0), (0, s, 0), half_angle_deg=30) for x, s in ((0, -1), (0, 1), (0.1, 1), (9, 1))]
    wall = make.quad((-3, 2, -3), (6, 0, 0), (0, 0, 6))
    surface = Surface(wall)
    points = np.array([[0, 2, 0.0], [0, 2, 2.9]])
    assert first_view(points, cameras, surface, surface).tolist() == [1, -1]
    assert count_views(points, cameras, surface, surface).tolist() == [2, 0]


def test_where_the_truth_has_no_surface_nothing_is_seen(make):
    camera = make.camera_at((0, 0, 0), (0, 1, 0))
    point = np.array([[0.0, 1.0, 0.0]])
    own = Surface(make.quad((-0.2, 1, -0.2), (0.4, 0, 0), (0, 0, 0.4)))
    beside = Surface(make.quad((1, 2, -1), (2, 0, 0), (0, 0, 2)))
    assert not sees(point, camera, own, beside)[0]
