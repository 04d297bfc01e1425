"""Up, walls and metres of a room whose truth is known."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose
from room2dgs.prepare.metres import height_over_floor, scale_by_length, scale_by_maps
from room2dgs.prepare.vanishing_points import room_frame

K = np.array([[260.0, 0, 160], [0, 260.0, 120], [0, 0, 1]])


def turn(axis, degrees: float) -> np.ndarray:
    return cv2.Rodrigues(np.asarray(axis, float) / np.linalg.norm(axis) * np.radians(degrees))[0]


def view(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """(3, 3) world_from_cam of a room with z up."""
    level = np.array([[0, 0, 1.0], [-1, 0, 0], [0, -1, 0]])  # looks along x
    return turn([0, 0, 1], yaw) @ level @ turn([1, 0, 0], pitch) @ turn([0, 0, 1], roll)


def drawn(camera: Camera, edges: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    picture = np.full((240, 320, 3), 255, np.uint8)
    for first, last in edges:
        points = first + np.linspace(0, 1, 200)[:, None] * (last - first)
        pixel, depth = camera.project(points)
        run = pixel[depth > 0.2]
        if len(run) > 1:
            cv2.polylines(picture, [(run * 16).round().astype(np.int32)], False, (0, 0, 0), 1, cv2.LINE_AA, 4)
    return picture


@pytest.mark.parametrize("walls", [True, False])
def test_a_tilted_room_is_turned_upright_and_along_its_walls(walls):
    rng = np.random.default_rng(1)
    edges = []
    for _ in range(60):  # upright edges, and level ones along the walls or anywhere
        x, y = rng.uniform(-4, 4, 2)
        edges.append((np.array([x, y, 0.0]), np.array([x, y, 2.5])))
        heading = rng.integers(0, 4) * 90 if walls else rng.uniform(0, 360)
        start = np.array([x, y, rng.uniform(0, 2.5)])
        edges.append((start, start + 2 * (turn([0, 0, 1], heading) @ [1.0, 0, 0])))
    world_from_room = turn([1, 2, -1], 70)
    cameras, pictures = [], []
    for yaw in range(0, 360, 30):
        pose = np.eye(4)
        pose[:3, :3] = view(yaw, rng.uniform(-15, 5), rng.uniform(-4, 4))
        pose[:3, 3] = [rng.uniform(-1, 1), rng.uniform(-1, 1), 1.4]
        camera = Camera(K, 320, 240, inverse_pose(pose))
        pictures.append(drawn(camera, edges))
        tilted = pose.copy()
        tilted[:3] = world_from_room @ pose[:3]
        cameras.append(Camera(K, 320, 240, inverse_pose(tilted)))
    found = room_frame(cameras, pictures)
    assert found.walls is walls
    turned = found.room_from_world @ world_from_room
    assert np.degrees(np.arccos(turned[2, 2])) < 0.5
    assert np.allclose(found.room_from_world @ found.room_from_world.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(found.room_from_world) > 0
    if walls:
        heading = np.degrees(np.arctan2(turned[0, 1], turned[0, 0])) % 90
        assert min(heading, 90 - heading) < 0.7


CENTRES = {f"frame_{i:06d}.jpg": np.array([0.5 * i, 0.0, 1.4]) for i in range(0, 30, 3)}
SECONDS = {name: index * 1.5 for index, name in enumerate(CENTRES)}


@pytest.mark.parametrize(
    ("length", "metres"),
    [
        (["27"], 2.0),  # the path is 13.5 units long
        (["frame_000003.jpg", "frame_000009", "6"], 2.0),
        (["3", "27", "6"], 0.5),
        (["1.5s", "4.6s", "6"], 2.0),
        (["height", "1.5"], 3.0),
    ],
)
def test_a_known_length_gives_the_unit(length, metres):
    assert scale_by_length(length, CENTRES, SECONDS, height=0.5).metres == pytest.approx(metres)


@pytest.mark.parametrize(
    ("length", "said"),
    [
        (["3", "4", "1"], "names 4, which is none of the placed photos"),
        (["3", "3", "1"], "cameras in one place"),
        (["3", "27", "-1"], "no length in metres"),
        (["3", "27"], "wants"),
        (["99.0s", "0s", "1"], "names 99.0s"),
    ],
)
def test_a_length_that_cannot_be_is_refused(length, said):
    with pytest.raises(InputError, match=said):
        scale_by_length(length, CENTRES, SECONDS, None)


def test_the_floor_is_the_lowest_full_level_not_the_table_nor_stray_points():
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(-2, 2, (120, 2)), rng.normal(0, 0.01, 120)]
    table = np.c_[rng.uniform(-1, 1, (700, 2)), rng.normal(0.75, 0.01, 700)]
    walls = np.c_[rng.uniform(-2, 2, (500, 2)), rng.uniform(0, 2.5, 500)]
    stray = np.c_[rng.uniform(-2, 2, (6, 2)), rng.uniform(-3, -0.5, 6)]
    centres = np.c_[rng.uniform(-1, 1, (20, 2)), rng.normal(1.5, 0.03, 20)]
    found = height_over_floor(np.concatenate([floor, table, walls, stray]), centres)
    assert found == pytest.approx(1.5, abs=0.04)
    assert height_over_floor(table + np.array([0, 0, 3.0]), centres) is None


def test_scale_by_maps_is_the_photos_median_with_their_spread(tmp_path):
    rng = np.random.default_rng(0)
    frames, frame, point, pixel, xyz = [], [], [], [], []
    for i in range(9):
        frames.append(Frame(f"{i}", Camera(K, 320, 240, np.eye(4)), tmp_path / f"{i}.jpg"))
        at = rng.uniform([0, 0], [320, 240], (50, 2))
        depth = rng.uniform(1, 4, 50)
        xyz.append(np.c_[(at - K[:2, 2]) / 260.0, np.ones(50)] * depth[:, None])
        frame += [i] * 50
        point += range(50 * i, 50 * i + 50)
        pixel.append(at)
    tracks = Tracks(
        tuple(f.name for f in frames), np.array(frame, np.int32), np.array(point, np.int32),
        np.concatenate(pixel).astype(np.float32),
    )  # fmt: skip
    cloud = PointCloud(np.concatenate(xyz), np.zeros((450, 3), np.uint8), tracks)

    def depth_of(one: Frame):
        if one.name == "8":
            return None
        depth = np.zeros((240, 320), np.float32)
        column, row = np.floor(pixel[int(one.name)]).astype(int).T
        factor = 9.0 if one.name == "7" else 2.5 * 1.02 ** (int(one.name) - 3)  # one photo is far off
        depth[row, column] = cloud.xyz[50 * int(one.name) : 50 * int(one.name) + 50, 2] * factor
        return depth, depth > 0

    found = scale_by_maps(frames, cloud, depth_of, "network", 0.1, lambda line: None)
    assert found.metres == pytest.approx(2.5, rel=0.03) and found.photos == 8
    assert 0.1 < found.sigma < 0.12
    assert scale_by_maps(frames, cloud, lambda one: None, "network", 0.1, lambda line: None) is None


def test_a_known_length_says_how_sure_it_is():
    pair = scale_by_length(["3", "27", "2+-0.01"], CENTRES, SECONDS, None)
    assert pair.metres == scale_by_length(["3", "27", "2"], CENTRES, SECONDS, None).metres
    assert pair.sigma == pytest.approx(0.005)
    height = scale_by_length(["height", "1.5+-0.06"], CENTRES, SECONDS, 0.5)
    assert height.sigma == pytest.approx(0.05)  # 3 % of where the floor is, 4 % of the length
