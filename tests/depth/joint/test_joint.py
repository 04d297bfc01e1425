"""Joint optimisation of depth maps, each with a smooth error of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.depth import depth_of_frames
from room2dgs.depth.joint import draws
from room2dgs.depth.joint import optimise as joint
from room2dgs.depth.joint.optimise import joint_depths
from room2dgs.depth.joint.overlap import Overlap, overlap, textureless_regions
from room2dgs.depth.joint.reference import axis_residuals, planarity_residuals, point_residuals
from room2dgs.depth.joint.room_axes import room_axes

SAMPLES = 20000
NOTHING = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))


@pytest.fixture(scope="module")
def ring(box_room, tmp_path_factory) -> tuple[list[Frame], dict[str, np.ndarray], dict[str, np.ndarray], PointCloud]:
    """Frames with textured photos on disk, exact depths, world normals, and points."""
    room = box_room(count=12, turn=0.3)
    folder = tmp_path_factory.mktemp("photos")
    rng = np.random.default_rng(3)
    frames = []
    for frame in room.frames:
        path = folder / frame.color_path.name
        cv2.imwrite(str(path), rng.integers(0, 255, (frame.camera.height, frame.camera.width, 3), dtype=np.uint8))
        frames.append(replace(frame, color_path=Path(path)))
    depths = {frame.name: depth.astype(np.float32) for frame, depth in zip(frames, room.depths, strict=True)}
    normals = {
        frame.name: (normal @ frame.camera.cam_from_world[:3, :3]).astype(np.float32)
        for frame, normal in zip(frames, room.normals, strict=True)
    }
    return frames, depths, normals, room.points


def warped(depths: dict[str, np.ndarray], size: float = 0.08) -> dict[str, np.ndarray]:
    """Each map times exp of its own wave."""
    found = {}
    for index, (name, depth) in enumerate(depths.items()):
        y, x = np.mgrid[0 : depth.shape[0], 0 : depth.shape[1]] / max(depth.shape)
        wave = np.cos(5.0 * x * np.cos(index) + 5.0 * y * np.sin(index) + 2.0 * index)
        found[name] = (depth * np.exp(size * wave)).astype(np.float32)
    return found


def samples(views: Overlap) -> torch.Tensor:
    return draws.drawn(views, SAMPLES, torch.Generator().manual_seed(0), axes=True).long()


def error(found: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> float:
    return float(np.mean([np.abs(found[name] / truth[name] - 1).mean() for name in found]))


def test_what_every_view_gets_wrong_in_its_own_way_is_found_out(ring):
    frames, depths, normals, points = ring
    spoilt = warped(depths)
    found = joint_depths(frames, spoilt, normals, points)
    assert error(spoilt, depths) > 0.04
    assert error(found.depths, depths) < 0.01
    assert found.between_views[1] < 0.3 * found.between_views[0]
    assert found.at_points[1] < 0.3 * found.at_points[0]


def test_views_help_each_other_where_there_are_no_points(ring):
    frames, depths, _, _ = ring
    spoilt = warped(depths)
    assert error(joint_depths(frames, spoilt, {}, NOTHING).depths, depths) < 0.6 * error(spoilt, depths)


def test_normals_help_a_view_that_has_nothing_else(ring):
    frames, depths, normals, _ = ring
    name = frames[0].name
    spoilt = {name: warped(depths)[name]}
    found = joint_depths(frames, spoilt, normals, NOTHING).depths[name]

    # neither views nor points give the scale
    def off(depth):
        return np.abs(depth / depths[name] / np.median(depth / depths[name]) - 1).mean()

    assert off(found) < 0.5 * off(spoilt[name])


@pytest.mark.slow
def test_true_maps_stay_true(ring):
    frames, depths, normals, points = ring
    assert error(joint_depths(frames, depths, normals, points).depths, depths) < 2e-3


def test_one_bad_map_does_not_spoil_the_others(ring):
    frames, depths, normals, points = ring
    rng = np.random.default_rng(0)
    spoilt = warped(depths)
    bad = frames[4].name
    spoilt[bad] = rng.uniform(0.5, 6.0, spoilt[bad].shape).astype(np.float32)
    found = joint_depths(frames, spoilt, normals, points).depths
    others = {name: depth for name, depth in found.items() if name != bad}
    assert error(others, depths) < 0.015


def test_full_confidence_everywhere_changes_no_bit(ring, monkeypatch):
    monkeypatch.setattr(joint, "STAGES", joint.STAGES[:1])
    frames, depths, normals, points = ring
    spoilt, confidence = warped(depths), {name: np.ones(depth.shape, np.float32) for name, depth in depths.items()}
    one = joint_depths(frames, spoilt, normals, points).depths
    other = joint_depths(frames, spoilt, normals, points, True, confidence, confidence).depths
    for name, depth in one.items():
        np.testing.assert_array_equal(depth, other[name])


@pytest.mark.slow
def test_pixels_of_low_confidence_are_less_stiff_and_spoil_no_other_view(ring, monkeypatch):
    monkeypatch.setattr(joint, "STAGES", joint.STAGES[:3])
    frames, depths, normals, _ = ring
    rng = np.random.default_rng(3)
    spoilt, confidence, wrong = warped(depths, 0.04), {}, {}
    for name, depth in spoilt.items():
        y, x = np.mgrid[0 : depth.shape[0], 0 : depth.shape[1]] / depth.shape[1]
        blob = np.exp(-((x - rng.uniform(0.2, 0.8)) ** 2 + (y - rng.uniform(0.15, 0.6)) ** 2) / (2 * 0.12**2))
        noise = cv2.GaussianBlur(rng.normal(size=depth.shape), (0, 0), 1.5)
        bump = rng.choice([-0.6, 0.6]) + 0.1 * noise / noise.std()
        spoilt[name] = (depth * np.exp(blob * bump)).astype(np.float32)
        confidence[name] = (1 / (1 + ((0.03 + 0.3 * blob) / 0.1) ** 2)).astype(np.float32)
        wrong[name] = blob > 0.4

    def errors(*weights):
        found = joint_depths(frames, spoilt, normals, NOTHING, True, *weights).depths
        off = {name: np.abs(found[name] / depths[name] - 1) for name in found}
        return [np.mean([off[name][wrong[name] == which].mean() for name in off]) for which in (False, True)]

    without, weighted = errors(), errors(confidence)
    assert weighted[0] < 0.8 * without[0] and weighted[1] < without[1]


@pytest.mark.slow
def test_normals_of_no_confidence_do_not_tilt_the_depth(ring, monkeypatch):
    monkeypatch.setattr(joint, "STAGES", joint.STAGES[:3])
    frames, depths, normals, points = ring
    turn = cv2.Rodrigues(np.array([0.3, 0.2, -0.25]))[0]
    turned = {name: (normal @ turn.T).astype(np.float32) for name, normal in normals.items()}
    nothing = {name: np.zeros(depth.shape, np.float32) for name, depth in depths.items()}
    with_normals = joint_depths(frames, depths, turned, points, False).depths
    without = joint_depths(frames, depths, turned, points, False, None, nothing).depths
    assert error(without, depths) < 2e-3 < error(with_normals, depths)


def test_the_same_maps_give_the_same_bits_and_holes_stay_holes(ring):
    frames, depths, normals, points = ring
    spoilt = warped(depths)
    spoilt[frames[1].name][10:20, 30:50] = 0.0
    first, second = (joint_depths(frames, spoilt, normals, points).depths for _ in range(2))
    for name, depth in first.items():
        np.testing.assert_array_equal(depth, second[name])
        np.testing.assert_array_equal(depth == 0, spoilt[name] == 0)


def test_no_maps_at_all_give_none(ring):
    frames, _, _, points = ring
    assert joint_depths(frames, {}, {}, points).depths == {}


def test_points_are_carried_into_other_views_exactly(ring):
    frames, depths, normals, points = ring
    views = overlap(frames, depths, normals, points)
    # a true map at a point's pixel has the point's depth, up to the pixel's size
    assert np.median(np.abs(views.point_prior.numpy() / views.point_depth.numpy() - 1)) < 5e-3
    view, other = views.pairs[0, :1], views.pairs[0, 1:]
    row = column = views.region.new_full((1,), 30).long()
    pixel = views.pixel(row, column)
    in_cam = views.cameras.rays(view, pixel) * views.depth[view, row, column][:, None]
    there, z = views.cameras.seen_by(other, view, in_cam)
    world = (in_cam[0].double().numpy() - frames[int(view)].camera.cam_from_world[:3, 3]) @ frames[
        int(view)
    ].camera.cam_from_world[:3, :3]
    camera = frames[int(other)].camera
    expected = camera.K @ (camera.cam_from_world[:3, :3] @ world + camera.cam_from_world[:3, 3])
    assert float(z) == pytest.approx(expected[2], rel=1e-4)
    np.testing.assert_allclose(there[0].numpy(), expected[:2] / expected[2], atol=0.02)


def textureless(frames: list[Frame], folder: Path) -> list[Frame]:
    """The same views of a room without texture: each photo is one grey."""
    path = folder / "grey.png"
    camera = frames[0].camera
    cv2.imwrite(str(path), np.full((camera.height, camera.width, 3), 90, np.uint8))
    return [replace(frame, color_path=path) for frame in frames]


def test_a_slanted_wall_is_a_plane_and_a_curved_one_is_not(ring, tmp_path):
    frames, depths, normals, _ = ring
    frames = textureless(frames, tmp_path)

    def deviations(maps: dict[str, np.ndarray]) -> torch.Tensor:
        views = overlap(frames, maps, normals)
        flat = torch.zeros(len(views), 3, 4)
        return planarity_residuals(views, flat, samples(views)[draws.PLANES]).abs()

    right = deviations(depths)
    assert len(right) > 500
    assert right.median() < 1e-5
    # walls seen frontally hardly curve, so the median is small: but well above what rounding gives a plane
    assert deviations({name: depth**1.2 for name, depth in depths.items()}).median() > 1e-4


def test_textureless_regions_are_measured_against_the_axes(ring, tmp_path):
    frames, depths, normals, _ = ring
    views = overlap(textureless(frames, tmp_path), depths, normals)
    flat = torch.zeros(len(views), 3, 4)
    turn = np.radians(5.0)
    turned = torch.tensor([[0, 0, 1.0], [np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0]]).float()

    def sines(axes: torch.Tensor) -> torch.Tensor:
        found = axis_residuals(views, flat, axes, samples(views)[draws.AXES]).abs()
        assert len(found) > 500
        return found

    right = sines(torch.eye(3)[[2, 0, 1]])
    assert right.median() < 2e-3
    # walls are off by the turn, floor and ceiling are not
    wrong = sines(turned)
    walls = wrong[(wrong - np.sin(turn)).abs() < 0.01]
    assert len(walls) > 0.3 * len(wrong)
    assert len(walls) + int((wrong < 0.01).sum()) > 0.95 * len(wrong)


def test_the_axes_of_a_box_are_found_and_those_of_a_round_room_are_not(ring):
    frames, depths, _, _ = ring
    views = overlap(frames, depths, {})
    axes = room_axes(views, torch.zeros(len(views), 3, 4))
    np.testing.assert_allclose(np.sort(np.abs(axes.numpy()), axis=1), [[0, 0, 1]] * 3, atol=0.02)
    assert float(axes[0, 2]) > 0.99  # up first
    np.testing.assert_allclose((axes @ axes.T).numpy(), np.eye(3), atol=1e-5)
    # a round wall about the cameras, floor and ceiling as they were
    round_room = {}
    for frame in frames:
        along = frame.camera.world_rays()
        wall = (3.0 / np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-9)).astype(np.float32)
        level = np.where(along[..., 2] < 0, -1.4, 1.2) / along[..., 2]
        round_room[frame.name] = np.minimum(wall, level).astype(np.float32)
    assert len(room_axes(overlap(frames, round_room, {}), torch.zeros(len(views), 3, 4))) == 1


def test_walls_are_textureless_regions_and_texture_is_none():
    photo = np.full((120, 160, 3), 120, np.uint8)
    photo[:, 80:] = 60  # a corner: two walls
    photo[80:, :] = np.random.default_rng(0).integers(0, 255, (40, 160, 3))
    region = textureless_regions(photo, step=2)
    assert region.shape == (60, 80)
    assert region[10, 10] > 0
    assert region[10, 70] > 0
    assert region[10, 10] != region[10, 70]
    assert (region[45:] == 0).mean() > 0.95


@pytest.mark.parametrize("joint", [True, False])
def test_loaded_maps_are_optimised_jointly_if_asked_and_the_log_has_the_residuals(ring, prior_config, tmp_path, joint):
    frames, depths, _, points = ring
    spoilt = warped(depths)
    for name, depth in spoilt.items():
        np.save(tmp_path / f"{name}.npy", depth)
    settings = prior_config("prior/depth=files", depth__path=tmp_path, depth__joint=str(joint).lower())
    lines: list[str] = []
    found = {
        name: prior.depth for name, prior in depth_of_frames(frames, points, settings, lines.append).by_frame.items()
    }
    assert (error(found, depths) < 0.015) == joint
    assert any("joint depth optimisation: views differ by" in line for line in lines) == joint


def test_maps_are_judged_by_points_that_photos_are_known_to_have_seen(ring):
    """Points behind walls are guessed to be seen; what photos did see says that the maps are right."""
    frames, depths, normals, points = ring
    xyz = np.concatenate([points.xyz, points.xyz * 1.15])  # the room is about the origin
    observed = []
    for index, frame in enumerate(frames):
        seen = seen_points(PointCloud(points.xyz, points.rgb), frame)
        observed.append((np.full(len(seen.index), index), seen.index, seen.pixel))
    frame_of, point_of, pixel = (np.concatenate(part) for part in zip(*observed, strict=True))
    tracks = Tracks(tuple(frame.name for frame in frames), frame_of, point_of, pixel.astype(np.float32))
    rgb = np.zeros((len(xyz), 3), np.uint8)
    known = joint_depths(frames, depths, normals, PointCloud(xyz, rgb, tracks))
    guessed = joint_depths(frames, depths, normals, PointCloud(xyz, rgb))
    assert known.outlier_ratio < 0.05
    assert guessed.outlier_ratio > 0.12


def test_maps_on_which_all_views_agree_but_the_points_do_not_are_trusted_less(ring, prior_config, tmp_path):
    frames, depths, _, points = ring
    # by more, and more unevenly, than a smooth grid can mend
    rng = np.random.default_rng(5)
    wrong = PointCloud(points.xyz + rng.uniform(-0.4, 0.4, points.xyz.shape), points.rgb)
    for name, depth in depths.items():
        np.save(tmp_path / f"{name}.npy", depth)
    config = prior_config("prior/depth=files", depth__path=tmp_path)
    sure = []
    for cloud in (points, wrong):
        found = depth_of_frames(frames, cloud, config, lambda line: None).by_frame
        assert len(found) == len(frames)
        sure.append(np.mean([maps.depth_confidence.mean() for maps in found.values()]))
    assert sure[1] < 0.8 * sure[0]


def test_a_view_with_few_points_has_the_same_say_as_one_with_many(ring):
    frames, depths, normals, points = ring
    views = overlap(frames[:2], depths, normals, points)
    number = torch.tensor([1000, 10])
    view = torch.repeat_interleave(torch.arange(2), number)
    ones = torch.ones(len(view))
    views = replace(
        views,
        point_view=view,
        point_px=torch.full((len(view), 2), 20.0),
        point_depth=ones,
        point_tracked=ones.bool(),
        point_prior=torch.where(view == 0, 1.0, np.e),
    )
    found = point_residuals(views, torch.zeros(2, 3, 4), samples(views)[draws.POINTS])
    assert set(found.unique().round().tolist()) == {0.0, 1.0}
    assert float(found.mean()) == pytest.approx(0.5, abs=0.05)
