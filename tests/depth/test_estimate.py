"""Maps on disk to aligned depth and world normals, and what is said about those that cannot be used."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.depth import depth_of_frames
from room2dgs.errors import InputError
from room2dgs.stereo.depth_samples import DepthSamples, with_depth_samples
from room2dgs.stereo.passes import FirstPass, StereoMap


def load(room, prior_config, folder, points=None, frames=None, **changes):
    lines: list[str] = []
    changes.setdefault("depth__joint", "false")  # joint optimisation is tested in joint/
    settings = prior_config("prior=files", depth__path=folder / "depth", normal__path=folder / "normal", **changes)
    priors = depth_of_frames(frames or room.frames, points or room.points, settings, lines.append)
    return priors, "\n".join(lines)


def test_each_view_gets_back_its_own_scale_and_shift(room, prior_config, map_files):
    folder = map_files(depth=lambda depth, i: (depth - 0.1 * i) / (0.5 + 0.2 * i))
    priors, _ = load(room, prior_config, folder, depth__meaning="relative_depth")
    for i, frame in enumerate(room.frames):
        prior = priors.by_frame[frame.name]
        assert priors.fits[frame.name].scale == pytest.approx(0.5 + 0.2 * i, rel=0.01)
        assert np.abs(prior.depth / room.depths[i] - 1.0).max() < 0.01
        assert prior.depth.dtype == np.float32
        assert (prior.depth > 0).all()
    assert priors.label == "files"


def test_disparity_maps_give_metres(room, prior_config, map_files):
    folder = map_files(depth=lambda depth, i: 300.0 / depth + 20.0)
    priors, _ = load(room, prior_config, folder, depth__meaning="relative_inverse_depth")
    for i, frame in enumerate(room.frames):
        assert np.abs(priors.by_frame[frame.name].depth / room.depths[i] - 1.0).max() < 0.02


def test_points_behind_the_walls_do_no_harm(room, prior_config, map_files):
    # another room next door: seen by the cameras, if walls were glass
    behind = room.points.xyz[::2] + np.array([0.0, 6.0, 0.0])
    points = PointCloud(np.concatenate([room.points.xyz, behind]), np.zeros((540, 3), np.uint8))
    priors, _ = load(room, prior_config, map_files(depth=lambda depth, i: 0.8 * depth), points)
    for i, frame in enumerate(room.frames):
        assert np.abs(priors.by_frame[frame.name].depth / room.depths[i] - 1.0).max() < 0.02


def test_normals_are_unit_world_and_face_the_camera(room, prior_config, map_files):
    priors, _ = load(room, prior_config, map_files())
    for i, frame in enumerate(room.frames):
        prior, pose = priors.by_frame[frame.name], frame.camera.cam_from_world[:3, :3]
        expected = room.normals[i] @ pose
        assert prior.normal.any(axis=-1).mean() > 0.99
        np.testing.assert_allclose(np.linalg.norm(prior.normal[prior.normal.any(axis=-1)], axis=-1), 1.0, atol=1e-6)
        assert (prior.normal * expected).sum(axis=-1)[prior.normal.any(axis=-1)].min() > 0.999


@pytest.mark.parametrize("axes", ["opencv", "opengl"])
@pytest.mark.parametrize("facing", ["camera", "away"])
@pytest.mark.parametrize("with_depth", [True, False])
def test_the_right_convention_is_named_whatever_the_files_have(room, prior_config, map_files, axes, facing, with_depth):
    flip = np.array({"opencv": (1, 1, 1), "opengl": (1, -1, -1)}[axes]) * {"camera": 1, "away": -1}[facing]
    folder = map_files(normal=lambda normal, i: normal * flip)
    extra = {} if with_depth else {"depth__source": "none"}
    priors, _ = load(room, prior_config, folder, normal__axes=axes, normal__facing=facing, **extra)
    prior = priors.by_frame[room.frames[2].name]
    expected = room.normals[2] @ room.frames[2].camera.cam_from_world[:3, :3]
    assert (prior.normal * expected).sum(axis=-1)[prior.normal.any(axis=-1)].min() > 0.999
    # OpenGL facing away is x negated: a depth prior shows it, and so do views of the same points.
    if (axes, facing) != ("opencv", "camera"):
        with pytest.raises(InputError) as refused:
            load(room, prior_config, folder, **extra)
        assert ("prior.normal.axes=opengl" in str(refused.value)) == (axes == "opengl")
        assert ("prior.normal.facing=away" in str(refused.value)) == (facing == "away")
        assert "\n" not in str(refused.value)


def test_world_normals_taken_for_camera_normals_are_refused(room, prior_config, map_files):
    folder = map_files(normal=lambda normal, i: normal @ room.frames[i].camera.cam_from_world[:3, :3])
    with pytest.raises(InputError, match=r"prior\.normal\.frame=world"):
        load(room, prior_config, folder)
    priors, _ = load(room, prior_config, folder, normal__frame="world")
    expected = room.normals[1] @ room.frames[1].camera.cam_from_world[:3, :3]
    prior = priors.by_frame[room.frames[1].name]
    assert (prior.normal * expected).sum(axis=-1)[prior.normal.any(axis=-1)].min() > 0.999


def test_one_flipped_axis_is_named(room, prior_config, map_files):
    folder = map_files(normal=lambda normal, i: normal * (1, -1, 1))
    with pytest.raises(InputError, match=r"prior\.normal\.axes=ruf fits best"):
        load(room, prior_config, folder)


def test_the_override_lets_a_wrong_convention_through_with_a_warning(room, prior_config, map_files):
    folder = map_files(normal=lambda normal, i: normal * (1, -1, -1))
    _, said = load(room, prior_config, folder, normal__check="false")
    assert "WARNING" in said
    assert "prior.normal.axes=opengl" in said


def test_noise_is_left_out_or_warned_about(room, prior_config, map_files):
    rng = np.random.default_rng(0)

    def noise(normal, i):
        random = rng.normal(size=normal.shape)
        random /= np.linalg.norm(random, axis=-1, keepdims=True)
        return random * -np.sign(random[..., 2:])

    folder = map_files(depth=lambda depth, i: rng.uniform(0.5, 6.0, depth.shape), normal=noise)
    priors, said = load(room, prior_config, folder)
    assert "WARNING: the normals carry no information" in said
    assert max(float(maps.depth_confidence.mean()) for maps in priors.by_frame.values()) < 0.15


def test_one_bad_map_has_next_to_no_weight(room, prior_config, map_files):
    rng = np.random.default_rng(1)
    folder = map_files(depth=lambda depth, i: depth if i != 3 else rng.uniform(0.3, 6.0, depth.shape))
    priors, _ = load(room, prior_config, folder)
    weight = {name: float(maps.depth_confidence.mean()) for name, maps in priors.by_frame.items()}
    bad = weight.pop(room.frames[3].name)
    assert bad < 0.15 and min(weight.values()) > 3 * bad
    assert priors.fits[room.frames[3].name].residual > 0.15


@pytest.mark.parametrize(("meaning", "kept"), [("metric_depth", True), ("relative_depth", False)])
def test_a_view_without_points_takes_the_common_scale_only_if_there_is_one(
    room, prior_config, map_files, meaning, kept
):
    lonely = room.frames[4]
    # out of the world of the points and of the other views, but the same room to its map
    away = lonely.camera.cam_from_world.copy()
    away[:3, 3] += 100.0
    frames = [*room.frames[:4], replace(lonely, camera=replace(lonely.camera, cam_from_world=away))]
    folder = map_files(depth=lambda depth, i: depth / 1.25)
    priors, said = load(room, prior_config, folder, frames=frames, depth__meaning=meaning, normal__source="none")
    assert (lonely.name in priors.by_frame) == kept
    assert lonely.name in said
    if kept:
        assert np.abs(priors.by_frame[lonely.name].depth / room.depths[4] - 1.0).max() < 0.01


def test_missing_maps_are_said_and_all_missing_is_an_error(room, prior_config, map_files):
    folder = map_files()
    (folder / "depth" / "6.npy").unlink()
    priors, said = load(room, prior_config, folder)
    assert "no map for 1 of 6 views: 000006" in said
    assert priors.by_frame["000006"].depth is None
    for file in (folder / "depth").iterdir():
        file.unlink()
    with pytest.raises(InputError, match=r"has no map for any of the 6 views.*0\.png"):
        load(room, prior_config, folder)


def test_none_reads_nothing(room, prior_config):
    priors = depth_of_frames(room.frames, room.points, prior_config())
    assert (priors.by_frame, priors.fits, priors.label) == ({}, {}, "none")


def test_without_alignment_metres_stay_as_they_are(room, prior_config, map_files):
    folder = map_files(depth=lambda depth, i: 1.1 * depth)
    priors, _ = load(room, prior_config, folder, depth__align="false")
    np.testing.assert_allclose(priors.by_frame["000000"].depth, 1.1 * room.depths[0], rtol=1e-4)  # 16 bits


def test_simulated_maps_say_so(room, prior_config, map_files):
    folder = map_files()
    (folder / "priors.json").write_text(json.dumps({"simulated": True}))
    priors, said = load(room, prior_config, folder)
    assert priors.label == "simulated"
    assert "simulated priors" in said


def test_a_view_without_points_is_aligned_to_the_views_beside_it(room, prior_config, map_files):
    # the other views' scales differ, so that only what they see tells this one's
    lonely, pose = room.frames[2], room.frames[2].camera
    in_cam = room.points.xyz @ pose.cam_from_world[:3, :3].T + pose.cam_from_world[:3, 3]
    pixel = in_cam[:, :2] / in_cam[:, 2:] * pose.K[(0, 1), (0, 1)] + pose.K[:2, 2]
    seen = (in_cam[:, 2] > 0) & ((pixel > -1) & (pixel < (pose.width + 1, pose.height + 1))).all(axis=1)
    points = room.points.chosen(~seen)
    folder = map_files(depth=lambda depth, i: (depth - 0.05 * i) / (0.5 + 0.2 * i))
    priors, said = load(
        room, prior_config, folder, points=points, depth__meaning="relative_depth", normal__source="none"
    )
    assert priors.fits[lonely.name].points == 0
    assert priors.fits[lonely.name].scale == pytest.approx(0.9, rel=0.03)
    assert np.abs(priors.by_frame[lonely.name].depth / room.depths[2] - 1.0).max() < 0.03
    assert f"depth prior of {lonely.name} aligned to" in said


def photographed(room, folder):
    """The frames, with grey photos on disk."""
    frames = [replace(frame, color_path=folder / frame.color_path.name) for frame in room.frames]
    for frame in frames:
        cv2.imwrite(str(frame.color_path), np.full((60, 80, 3), 128, np.uint8))
    return frames


@pytest.mark.parametrize(
    ("settings", "times"),
    [
        ({}, 2),
        ({"depth__second_pass": False}, 1),
        ({"depth__completion": False}, 1),
        ({"depth__joint": False}, 0),
        ({"depth__source": "none"}, 0),
    ],
)
def test_stereo_is_asked_twice_at_most_and_only_for_maps_that_it_can_hold(
    room, prior_config, map_files, tmp_path, settings, times
):
    frames = photographed(room, tmp_path)
    folder = map_files()
    paths = {"depth__path": folder / "depth", "normal__path": folder / "normal"}
    asked = []

    def compare(first: FirstPass | None) -> DepthSamples:
        asked.append(first)
        return DepthSamples(room.points, {})

    depth_of_frames(frames, room.points, prior_config("prior=files", **paths, **settings), lambda line: None, compare)
    assert len(asked) == times and asked[:1] == [None][:times]


@pytest.mark.parametrize("normals", [{}, {"normal__source": "none"}])
def test_a_second_pass_gets_what_the_first_came_to_and_its_word_counts(
    room, prior_config, map_files, tmp_path, normals
):
    """Maps that are 5 % too far; stereo has them 2 % too far at first and right in the second pass."""
    frames = photographed(room, tmp_path)
    folder = map_files(depth=lambda depth, i: 1.05 * depth)
    paths = {"depth__path": folder / "depth", "normal__path": folder / "normal"}
    config = prior_config("prior=files", **paths, **normals)
    far = [(1.02 * depth).astype(np.float32) for depth in room.depths]
    maps = {
        frame.name: StereoMap(depth, np.full(depth.shape, 7, np.uint8))
        for frame, depth in zip(frames, far, strict=True)
    }
    right = {
        name: StereoMap((depth / 1.02).astype(np.float32), num_consistent)
        for name, (depth, num_consistent) in maps.items()
    }
    nothing = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    cameras = [frame.camera for frame in frames]
    said = []

    def compare(first: FirstPass | None) -> DepthSamples:
        found = maps if first is None else right
        if first:
            assert first.maps is maps
            off = [first.completed[f.name] / d - 1 for f, d in zip(frames, room.depths, strict=True)]
            said.append(float(np.median(off)))
        return DepthSamples(with_depth_samples(nothing, frames, cameras, found), found)

    priors = depth_of_frames(frames, nothing, config, lambda line: None, compare)
    off = [priors.by_frame[f.name].depth / d - 1 for f, d in zip(frames, room.depths, strict=True)]
    assert said == [pytest.approx(0.02, abs=0.003)] and abs(float(np.median(off))) < 0.003


def test_what_stereo_finds_holds_the_depth(room, prior_config, map_files, tmp_path):
    """Maps that are 5 % too far, without any sparse point, are drawn to where stereo has the walls."""
    frames = photographed(room, tmp_path)
    folder = map_files(depth=lambda depth, i: 1.05 * depth)
    config = prior_config("prior=files", depth__path=folder / "depth", normal__path=folder / "normal")
    nothing = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    found = []
    for points in (nothing, room.points):
        held = DepthSamples(points, {})
        priors = depth_of_frames(frames, nothing, config, lambda line: None, lambda first, held=held: held)
        off = [priors.by_frame[f.name].depth / d - 1 for f, d in zip(frames, room.depths, strict=True)]
        found.append(float(np.median(np.abs(off))))
    assert found[0] == pytest.approx(0.05, abs=0.01) and found[1] < 0.01
