"""What each option changes, and what it must leave alone."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import pytest

from room2dgs import cli
from room2dgs.demo_room.geometry import triangulated
from room2dgs.demo_room.layout import room_patches
from room2dgs.demo_room.path import CLEARANCE, camera_path, pose
from room2dgs.demo_room.render import build_room, exposed, pinhole, ray_scene, render


def files(path) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(p.relative_to(path)): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


def wall_detail(capture) -> float:
    """Median colour step between horizontal neighbours on the walls, in 8-bit levels."""
    steps = []
    for i, color in enumerate(capture.colors):
        points, grey = capture.points(i), color.mean(axis=2)
        on_wall = np.min([np.abs(points[..., k] - edge) for k, edge in ((0, 0), (0, 4.5), (1, 0), (1, 3.5))], axis=0)
        wall = (on_wall < 0.002) & (capture.depths[i] > 0)
        # the outermost pixels of a wall are mixed with what is before it
        inner = wall[:, :-3] & wall[:, 1:-2] & wall[:, 2:-1] & wall[:, 3:]
        inner[1:-1] &= inner[:-2] & inner[2:]
        steps.append(np.abs(grey[:, 2:-1] - grey[:, 1:-2])[inner])
    return float(np.median(np.concatenate(steps)))


def test_same_options_give_the_same_bytes(plain, tmp_path):
    again = tmp_path / "again"
    size = ["--frames", "12", "--width", "96", "--height", "72", "--noise", "0", "--jpeg-quality", "100"]
    assert cli.main(["demo", str(again), "--seed", "3", *size]) == 0
    assert files(again) == files(plain.path)


def test_another_seed_is_another_room(plain, blank):
    assert not np.allclose(plain.poses, blank.poses, atol=0.05)
    assert (plain.path / "gt_mesh.ply").read_bytes() != (blank.path / "gt_mesh.ply").read_bytes()


def test_blank_walls_have_no_texture(plain, blank):
    assert wall_detail(plain) > 3.0
    assert wall_detail(blank) <= 1.0


@pytest.mark.parametrize("count", range(5))
def test_blank_walls_are_counted_and_bare_of_pictures(count):
    patches = room_patches(3, count)
    walls = [patch for patch in patches if patch.tag.startswith("wall")]
    assert [patch.material.kind for patch in walls].count("paint") == count
    pictures = [patch for patch in patches if patch.tag == "picture"]
    for wall in walls:
        if wall.material.kind == "paint":
            _, normal = wall.points_at(np.array(0.5), np.array(0.5))
            offset = [float(((p.grid - wall.grid[0, 0]) @ normal).min()) for p in pictures]
            assert all(distance > 0.1 for distance in offset)


def test_a_blank_wall_leaves_the_furniture_alone():
    def furniture(count):
        return [p for p in room_patches(3, count) if not p.tag.startswith("wall") and p.tag != "picture"]

    for papered, bare in zip(furniture(0), furniture(4), strict=True):
        np.testing.assert_array_equal(papered.grid, bare.grid)
        assert papered.material == bare.material


def test_exposure_drift_changes_brightness_and_nothing_else(plain, drifting):
    before, after = files(plain.path), files(drifting.path)
    for name in before:
        if not name.startswith("color/") and name != "room.json":
            assert before[name] == after[name], name
    ratios = []
    for constant, changed in zip(plain.colors, drifting.colors, strict=True):
        usable = (constant > 20) & (constant < 180) & (changed > 20) & (changed < 245)
        ratios.append(np.median(((changed[usable] / 255 + 0.055) / (constant[usable] / 255 + 0.055)) ** 2.4))
    stops = np.log2(ratios)
    assert np.abs(stops).max() == pytest.approx(1.0, abs=0.05)
    assert np.ptp(stops) > 0.5


def test_noise_has_the_given_deviation():
    flat = np.full((200, 200, 3), 0.2, np.float32)
    photo = exposed(flat, 1.0, 4.0, np.random.default_rng(0)).astype(float)
    assert photo.std() == pytest.approx(4.0, rel=0.02)
    assert photo.mean() == pytest.approx(255 * (1.055 * 0.2 ** (1 / 2.4) - 0.055), abs=0.2)


@pytest.mark.parametrize("seed", range(6))
def test_camera_keeps_clear_of_everything(seed):
    scene = ray_scene(triangulated(room_patches(seed, 0)))

    def distance(points):
        return scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()

    poses = camera_path(60, distance, np.random.default_rng([seed, 4]))
    assert distance(poses[:, :3, 3]).min() >= CLEARANCE == 0.35
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() < 0.4
    forward = poses[:, :3, 2]
    turns = np.degrees(np.arccos(np.clip((forward[1:] * forward[:-1]).sum(1), -1, 1)))
    assert turns.max() < 28  # the field of view is 70 degrees: neighbours overlap
    heading = np.degrees(np.arctan2(forward[:, 1], forward[:, 0])) % 360
    assert len(np.unique(heading // 30)) == 12  # all around


def test_a_walk_with_many_frames_a_lap_is_as_smooth_as_a_video():
    poses = camera_path(360, lambda points: np.ones(len(points)), np.random.default_rng([0, 4]), 336)
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert 0.005 < np.median(steps) < 0.04 and steps.max() < 0.05  # at 30 a second: a slow walk


def test_gloss_mirrors_on_the_floor_alone():
    tags = ("floor", "ceiling", "light", "wall0", "wall1", "wall2", "wall3")
    room = build_room([patch for patch in room_patches(0, 0) if patch.tag in tags], 0)
    K, world_from_cam = pinhole(96, 72, 70), pose(np.array([1.0, 1.0, 1.5]), 0.7, -0.3, 0.0)
    matt, depth = render(room, K, world_from_cam, 96, 72, 0.0)
    polished, same_depth = render(room, K, world_from_cam, 96, 72, 1.0)
    np.testing.assert_array_equal(depth, same_depth)
    row = (np.arange(72) + 0.5 - K[1, 2])[:, None] / K[1, 1] * np.ones((1, 96))
    column = (np.arange(96) + 0.5 - K[0, 2])[None] / K[0, 0] * np.ones((72, 1))
    height = 1.5 + depth * (np.stack([column, row, np.ones_like(row)], -1) @ world_from_cam[2, :3])
    changed = np.abs(polished - matt).max(axis=2) > 1e-4
    assert np.mean(changed[height < 0.001]) > 0.95
    assert not changed[height > 0.1].any()
