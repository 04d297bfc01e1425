"""Views stand in free air, look at something, and cover what hands do."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.demo_room.geometry import triangulated
from room2dgs.demo_room.light import cast
from room2dgs.demo_room.render import ray_scene
from room2dgs.tools.random_rooms.cameras import CLEARANCE, NEAR, draw, marched, picture_rays, random_views
from room2dgs.tools.random_rooms.layout import random_room

pytestmark = pytest.mark.slow

COUNT = 6


@pytest.fixture(scope="module")
def viewed() -> list:
    """Some rooms, their scenes and views."""
    found = []
    for seed in range(10):
        room = random_room(np.random.default_rng([21, seed]))
        scene = ray_scene(triangulated(room.patches))
        found.append((room, scene, random_views(room, distance_in(scene), np.random.default_rng(seed), COUNT)))
    return found


def distance_in(scene):
    return lambda points: scene.compute_distance(np.ascontiguousarray(points, np.float32)).numpy()


def test_every_room_gets_its_views_inside_and_with_clearance(viewed):
    close = 0
    for room, scene, views in viewed:
        assert len(views) == COUNT
        centres = np.array([pose[:3, 3] for _, pose in views])
        assert room.inside(centres).all()
        assert not room.blocked(centres).any()
        clearance = distance_in(scene)(centres)
        assert (clearance >= 0.5 * CLEARANCE - 1e-5).all()
        close += int((clearance < CLEARANCE - 1e-5).any())
    assert close <= 1  # only where the room is crammed


def test_poses_are_rigid_and_fields_of_view_within_reason(viewed):
    for _, _, views in viewed:
        for fov, world_from_cam in views:
            assert 45 <= fov <= 95
            assert world_from_cam[:3, :3].T @ world_from_cam[:3, :3] == pytest.approx(np.eye(3), abs=1e-9)
            assert np.linalg.det(world_from_cam[:3, :3]) == pytest.approx(1)


def test_most_of_a_picture_is_not_right_before_the_lens(viewed):
    facing = []
    for _, scene, views in viewed:
        for fov, world_from_cam in views:
            directions = picture_rays(fov) @ world_from_cam[:3, :3].T
            origins = np.broadcast_to(world_from_cam[:3, 3], directions.shape)
            hits = cast(scene, origins, directions)
            assert np.median(hits["t_hit"]) > NEAR
            facing.append((np.einsum("ni,ni->n", hits["primitive_normals"], directions) < 0).mean())
    assert np.mean(facing) > 0.995


def test_the_same_seed_gives_the_same_views(viewed):
    room, scene, views = viewed[0]
    again = random_views(room, distance_in(scene), np.random.default_rng(0), COUNT)
    for (fov, pose), (fov_again, pose_again) in zip(views, again, strict=True):
        assert fov == fov_again
        assert (pose == pose_again).all()


def test_sphere_tracing_finds_a_wall_at_its_distance():
    def to_plane(points: np.ndarray) -> np.ndarray:  # the wall x = 3
        return np.abs(3.0 - points[:, 0])

    rays = np.array([(1.0, 0, 0), (np.cos(0.5), np.sin(0.5), 0)])
    lengths = marched(to_plane, np.zeros((2, 3)), rays)
    assert lengths == pytest.approx([3.0, 3.0 / np.cos(0.5)], abs=0.05)


def test_hands_are_mostly_level_and_look_a_little_down():
    rng = np.random.default_rng(0)
    bounds = np.array([[0, 0, 0], [4, 3, 2.5]], float)
    poses = np.array([draw(rng, np.array([2, 1.5, 1.5]), bounds)[1] for _ in range(3000)])
    pitch = np.degrees(np.arcsin(poses[:, 2, 2]))
    roll = np.degrees(np.arctan2(poses[:, 2, 0], -poses[:, 2, 1]))
    assert -16 < np.median(pitch) < -6
    assert ((pitch > -36) & (pitch < 11)).mean() > 0.8
    assert pitch.min() < -55
    assert pitch.max() > 25
    assert (np.abs(roll) < 4.5).mean() > 0.75
    assert 0.02 < (np.abs(roll) > 60).mean() < 0.09  # held upright
