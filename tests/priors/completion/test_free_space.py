"""Free space: what rays passed through, what they ended on, and what that does to depth that views share."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.geometry.camera import Camera
from room2dgs.priors.completion import free_space as module
from room2dgs.priors.completion.free_space import Anchors, free_space, seen_through
from room2dgs.priors.completion.views import complete_views

WALL_M = 2.0


@pytest.fixture
def facing_a_wall(make):
    """`facing_a_wall(count)`: cameras side by side, 2 m in front of a wall at x = 2 m that they all have right."""
    return lambda count: [
        _anchored(make.camera_at((0.0, 0.02 * index, 0.0), (1.0, 0, 0), half_angle_deg=30)) for index in range(count)
    ]


def _anchored(camera: Camera) -> Anchors:
    shape = (camera.height, camera.width)
    return Anchors(camera, np.full(shape, WALL_M), np.ones(shape))


def test_in_front_of_a_wall_is_seen_through_and_the_wall_is_not(facing_a_wall):
    space = free_space(facing_a_wall(8))
    assert space is not None
    at = np.array([[1.0, 0.2, 0.0], [1.7, 0.2, 0.0], [WALL_M, 0.2, 0.0], [2.2, 0.2, 0.0], [50.0, 0.0, 0.0]])
    share = seen_through(space, at)
    np.testing.assert_allclose(share[:2], 8 / (8 + module.DOUBT))
    np.testing.assert_array_equal(share[2:], 0)
    assert seen_through(space, at.reshape(5, 1, 3)).shape == (5, 1)


def test_one_view_that_looks_through_what_others_see_says_little(facing_a_wall):
    views = facing_a_wall(8)
    views[3] = views[3]._replace(depth=np.full_like(views[3].depth, 3.0))
    space = free_space(views)
    assert seen_through(space, np.array([[WALL_M, 0.2, 0.0]]))[0] == 0
    alone = free_space(views[3:4])
    assert seen_through(alone, np.array([[WALL_M, 0.2, 0.0]]))[0] < 0.4


def test_anchors_that_are_not_trusted_say_nothing(facing_a_wall):
    views = [one._replace(trust=np.full_like(one.trust, 0.9 * module.LEAST_TRUST)) for one in facing_a_wall(4)]
    assert free_space(views) is None
    np.testing.assert_array_equal(seen_through(None, np.ones((3, 4, 3))), np.zeros((3, 4)))


def test_threads_count_the_same(facing_a_wall):
    views = facing_a_wall(5)
    with ThreadPoolExecutor(3) as pool:
        several = free_space(views, pool.map)
    one = free_space(views)
    assert one is not None and several is not None
    np.testing.assert_array_equal(one.through, several.through)
    np.testing.assert_array_equal(one.ended, several.ended)


def test_a_vast_room_has_larger_cells(facing_a_wall, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "MOST_CELLS", 2000)
    space = free_space(facing_a_wall(4))
    assert space is not None and space.cell > module.CELL_M and space.through.size < 2 * 2000
    assert seen_through(space, np.array([[1.0, 0.1, 0.0]]))[0] > 0.5


def left_half(room, depths, points, through: bool, names, misfit=0.0) -> tuple[float, float]:
    """Mean relative error and mean confidence of the completed depth there."""
    found = {}
    complete_views(
        room.frames,
        depths,
        {},
        {},
        {},
        points,
        {},
        dict.fromkeys(depths, misfit),
        lambda line: None,
        lambda *one: found.update({one[0]: one[1:]}),
        planes=False,
        through=through,
    )
    inner = (slice(5, -5), slice(5, 35))
    truth = {frame.name: depth for frame, depth in zip(room.frames, room.depths, strict=True)}
    off = np.mean([np.abs(found[name][0][inner] / truth[name][inner] - 1).mean() for name in names])
    return float(off), float(np.mean([found[name][1][inner].mean() for name in names]))


def anchored(frames, depths, left_out=()) -> PointCloud:
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


def test_a_mistake_that_many_views_share_is_not_believed_where_others_look_through_it(seen):
    """Every other view has it, and nothing there to hold it."""
    room, depths = seen
    names = [frame.name for frame in room.frames[::2]]
    points = anchored(room.frames, depths, left_out=names)
    sure = [left_half(room, too_near(depths, names), points, through, names)[1] for through in (False, True)]
    assert sure[1] < 0.5 * sure[0]


def test_anchors_that_others_look_through_do_not_bend_the_depth(seen):
    """Of maps that fitted the points badly, so that anchors rule."""
    room, depths = seen
    names = [room.frames[5].name]
    points = anchored(room.frames, too_near(depths, names))
    off = [left_half(room, depths, points, through, names, misfit=0.15)[0] for through in (False, True)]
    assert off[0] > 0.1 and off[1] < 0.02
