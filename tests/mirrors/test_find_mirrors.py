"""A mirror is found where it hangs, however the world lies; an opening and a whole wall are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs.mirrors import find
from room2dgs.mirrors.find import find_mirrors
from room2dgs.mirrors.mirror import shown
from tests.mirrors.made import HIGH, LOW, moved, room_views

OFF_M = 0.11  # a cell of the wall's grid
CORNERS = np.array([[LOW[0], 0, LOW[1]], [HIGH[0], 0, LOW[1]], [HIGH[0], 0, HIGH[1]], [LOW[0], 0, HIGH[1]]])


@pytest.fixture(scope="module")
def mirrored():
    return room_views("mirror")


@pytest.fixture(scope="module")
def found(mirrored):
    return find_mirrors(mirrored)


def off(corners: np.ndarray, true: np.ndarray) -> float:
    """The farthest that a true corner is from the nearest of the found."""
    return np.linalg.norm(corners[None] - true[:, None], axis=2).min(axis=1).max()


def test_a_mirror_is_found_in_its_wall(found):
    (mirror,) = found
    assert off(mirror.corners, CORNERS) < 1.5 * OFF_M
    np.testing.assert_allclose(mirror.normal, [0, 1, 0], atol=0.02)
    assert np.abs(mirror.corners @ [0, 1, 0]).max() < 0.03
    assert 4 <= mirror.photos <= 10


def test_its_pixels_are_those_that_show_the_room_behind_the_wall(mirrored, found):
    right = marked = true = 0
    for view in mirrored:
        place = view.camera.centre + view.camera.world_rays() * view.depth[..., None]
        behind, glass = place[..., 1] < -0.05, shown(view.depth, view.camera, found) > 0
        right, marked, true = right + (behind & glass).sum(), marked + glass.sum(), true + behind.sum()
    assert right > 0.85 * true and right > 0.9 * marked


@pytest.mark.parametrize("rectangle", ["opening", "twin", "shallow", "symmetric"])
def test_an_opening_into_another_room_is_no_mirror(rectangle):
    assert find_mirrors(room_views(rectangle)) == []


def test_a_hole_without_a_wall_around_it_is_no_mirror(mirrored):
    """The wall is measured only far from the mirror."""
    hidden = []
    for view in mirrored:
        place = view.camera.centre + view.camera.world_rays() * view.depth[..., None]
        near = (np.abs(place[..., 1]) < 0.01) & (place[..., 0] < HIGH[0] + 0.6)
        hidden.append(replace(view, depth=np.where(near, 0, view.depth)))
    assert find_mirrors(hidden) == []


def test_what_three_views_show_is_not_enough(mirrored):
    assert find_mirrors(mirrored[3:6] + mirrored[10:]) == []
    assert find_mirrors(mirrored[3:7] + mirrored[10:]) != []


def test_a_whole_wall_is_not_asked_further(monkeypatch):
    monkeypatch.setattr(find, "settled", lambda *_: pytest.fail("there is nothing behind any wall"))
    assert find_mirrors(room_views("wall")) == []


def test_nothing_measured_is_no_mirror(mirrored):
    assert find_mirrors([replace(one, depth=0 * one.depth) for one in mirrored]) == []


def test_what_only_one_view_measures_is_no_evidence(mirrored):
    alone = [replace(one, num_consistent=np.ones_like(one.num_consistent)) for one in mirrored]
    assert find_mirrors(alone) == []


def test_it_is_found_in_any_world(mirrored):
    world_from_room = np.eye(4)
    world_from_room[:3, :3] = Rotation.from_euler("xyz", [80, -35, 20], degrees=True).as_matrix()
    world_from_room[:3, 3] = 30.0, -7.0, 12.0
    (mirror,) = find_mirrors(moved(mirrored, world_from_room))
    true = CORNERS @ world_from_room[:3, :3].T + world_from_room[:3, 3]
    assert off(mirror.corners, true) < 2 * OFF_M
    assert mirror.normal @ world_from_room[:3, 1] > np.cos(np.radians(2))


def test_it_is_the_same_each_time(mirrored, found):
    np.testing.assert_array_equal(find_mirrors(mirrored)[0].corners, found[0].corners)
