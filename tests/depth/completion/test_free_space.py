"""Free space: what rays passed through, what they ended on, and what that does to depth that views share."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.depth.completion import free_space as module
from room2dgs.depth.completion.free_space import (
    Rays,
    free_space,
    less_where_seen_through,
    rays_to,
    seen_through,
)
from room2dgs.geometry.camera import Camera
from room2dgs.splat import set_threads
from tests.oracles.free_space import cells_of_view_reference, seen_through_reference

WALL_M = 2.0


@pytest.fixture
def facing_a_wall(make):
    """`facing_a_wall(count)`: rays of cameras side by side, 2 m in front of a wall at x = 2 m that all have right."""
    return lambda count: [
        _rays(make.camera_at((0.0, 0.02 * index, 0.0), (1.0, 0, 0), half_angle_deg=30)) for index in range(count)
    ]


def _rays(camera: Camera) -> Rays:
    depth = np.full((camera.height, camera.width), WALL_M)
    return Rays(camera.centre, camera.unproject_map(depth).reshape(-1, 3))


def test_in_front_of_a_wall_is_seen_through_and_the_wall_is_not(facing_a_wall):
    space = free_space(facing_a_wall(8))
    assert space is not None
    at = np.array([[1.0, 0.2, 0.0], [1.7, 0.2, 0.0], [WALL_M, 0.2, 0.0], [2.2, 0.2, 0.0], [50.0, 0.0, 0.0]])
    share = seen_through(space, at)
    np.testing.assert_allclose(share[:2], 8 / (8 + module.DOUBT))
    np.testing.assert_array_equal(share[2:], 0)
    assert seen_through(space, at.reshape(5, 1, 3)).shape == (5, 1)


def test_one_view_that_passes_through_what_others_see_says_little(facing_a_wall):
    views = facing_a_wall(8)
    views[3] = views[3]._replace(ends=views[3].centre + 1.5 * (views[3].ends - views[3].centre))
    assert seen_through(free_space(views), np.array([[WALL_M, 0.2, 0.0]]))[0] == 0
    alone = seen_through(free_space(views[3:4]), np.array([[WALL_M, 0.2, 0.0]]))[0]
    assert 0 < alone < 0.4


def test_where_nothing_is_known_nothing_is_seen_through():
    assert free_space([]) is None
    assert free_space([Rays(np.zeros(3), np.zeros((0, 3)))]) is None
    np.testing.assert_array_equal(seen_through(None, np.ones((3, 4, 3))), np.zeros((3, 4)))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.sampled_from([0.3, 3.0, 300.0]))
def test_the_kernels_are_the_reference(seed, count, reach):
    """To the last bit: ends in any direction, some of them in the camera, most cells of the largest left out."""
    rng = np.random.default_rng(seed)
    views = []
    for _ in range(count):
        centre = rng.normal(size=3)
        ends = centre + rng.normal(size=(rng.integers(0, 60), 3)) * rng.choice([0, 0.01, 1, reach], (1, 3))
        views.append(Rays(centre, ends))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "MOST_CELLS", 2**17)  # as many as rooms may have take seconds
        space = free_space(views)
    if not sum(len(view.ends) for view in views):
        assert space is None
        return
    through, ended = np.zeros(space.through.shape, np.int32), np.zeros(space.through.shape, np.int32)
    for view in views:
        passed, met = cells_of_view_reference(view, space.corner, space.cell, through.shape)
        through += passed
        ended += met
    np.testing.assert_array_equal(space.through, through)
    np.testing.assert_array_equal(space.ended, module.maximum_filter(ended, 3, mode="constant"))
    at = np.concatenate([view.ends for view in views] + [rng.normal(size=(50, 3)) * 2])
    np.testing.assert_array_equal(seen_through(space, at), seen_through_reference(space, at))


def test_threads_count_the_same(facing_a_wall):
    counts = []
    for threads in (1, 3):
        set_threads(threads)
        space = free_space(facing_a_wall(5))
        assert space is not None
        counts.append((space.through, space.ended))
    set_threads(None)
    np.testing.assert_array_equal(*(one[0] for one in counts))
    np.testing.assert_array_equal(*(one[1] for one in counts))


def test_a_vast_room_has_larger_cells(facing_a_wall, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "MOST_CELLS", 2000)
    space = free_space(facing_a_wall(4))
    assert space is not None and space.cell > module.CELL_M and space.through.size < 2 * 2000
    assert seen_through(space, np.array([[1.0, 0.1, 0.0]]))[0] > 0.5


@pytest.fixture
def left_half(complete_views):
    """`left_half(room, depths, points, through, names)`: the completed depth's mean relative error and weight there."""
    return partial(of_left_half, complete_views)


def of_left_half(complete_views, room, depths, points, through, names, misfit=0.0, others=False):
    space = free_space([rays_to(points, frame) for frame in room.frames]) if through else None
    points = less_where_seen_through(points, space)
    residuals = dict.fromkeys(depths, misfit)
    found = complete_views(
        room.frames, depths, {}, points, residuals=residuals, space=space, planes=False, other_views=others
    )
    inner = (slice(5, -5), slice(5, 35))
    truth = {frame.name: depth for frame, depth in zip(room.frames, room.depths, strict=True)}
    off = np.mean([np.abs(found[name][0][inner] / truth[name][inner] - 1).mean() for name in names])
    return float(off), float(np.mean([found[name][1][inner].mean() for name in names]))


def sampled(frames, depths, left_out=()) -> PointCloud:
    """Every other pixel of the depth maps, but of the left half of those views that have none there."""
    xyz, frame_of, pixels = [], [], []
    for index, frame in enumerate(frames):
        height, width = depths[frame.name].shape
        y, x = (part.ravel() for part in np.mgrid[0:height:2, 0:width:2])
        if frame.name in left_out:
            y, x = y[x >= 40], x[x >= 40]
        pixels.append(np.stack([x, y], axis=1) + 0.5)
        xyz.append(frame.camera.unproject(pixels[-1], depths[frame.name][y, x]))
        frame_of.append(np.full(len(x), index))
    count, names = sum(map(len, xyz)), tuple(frame.name for frame in frames)
    pixel = np.concatenate(pixels).astype(np.float32)
    tracks = Tracks(names, np.concatenate(frame_of), np.arange(count), pixel)
    return PointCloud(np.concatenate(xyz), np.zeros((count, 3), np.uint8), tracks)


def too_near(depths, names) -> dict[str, np.ndarray]:
    """Half of these views' pictures is a fifth nearer than it is."""
    wrong = {name: depth.copy() for name, depth in depths.items()}
    for name in names:
        wrong[name][:, :40] *= 0.8
    return wrong


@pytest.fixture
def seen(box_room):
    room = box_room(count=12, turn=0.02)
    return room, {frame.name: depth.astype(np.float32) for frame, depth in zip(room.frames, room.depths, strict=True)}


def test_a_mistake_that_many_views_share_is_not_believed_where_others_pass_through_it(left_half, seen):
    """Every other view has it, and nothing there to hold it."""
    room, depths = seen
    names = [frame.name for frame in room.frames[::2]]
    points = sampled(room.frames, depths, left_out=names)
    sure = [left_half(room, too_near(depths, names), points, through, names)[1] for through in (False, True)]
    # the other half's maps contradict it already, so that little is left to take
    assert sure[1] < 0.6 * sure[0] < 0.1


def test_a_mistake_of_half_the_views_is_mended_by_the_others(left_half, seen):
    """Of maps that fitted the points badly. Nothing holds them there but what the others have, which have points.

    That is no evidence: they count for as little as what they would have found alone.
    """
    room, depths = seen
    names = [frame.name for frame in room.frames[::2]]
    points = sampled(room.frames, depths, left_out=names)
    wrong = too_near(depths, names)
    alone, helped = (left_half(room, wrong, points, False, names, 0.15, others) for others in (False, True))
    assert alone[0] > 0.19 and helped[0] < 0.02
    assert helped[1] < alone[1] < 0.1
    right = [frame.name for frame in room.frames[1::2]]
    assert left_half(room, wrong, points, False, right, 0.15, True)[1] > 0.5


def test_samples_that_others_pass_through_do_not_bend_the_depth(left_half, seen):
    """Of maps that fitted the points badly, so that samples rule."""
    room, depths = seen
    names = [room.frames[5].name]
    points = sampled(room.frames, too_near(depths, names))
    off = [left_half(room, depths, points, through, names, misfit=0.15)[0] for through in (False, True)]
    assert off[0] > 0.1 and off[1] < 0.02


def test_points_that_are_hardly_trusted_send_no_rays(left_half, seen):
    room, depths = seen
    points = replace(sampled(room.frames, depths), weight=np.full(len(sampled(room.frames, depths)), 0.2, np.float32))
    assert not len(rays_to(points, room.frames[0]).ends)
