"""What a network that corrects completed depth gets to see, and what is made of its word."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest

from room2dgs.captures.uncertainty import completed_weight
from room2dgs.depth import depth_of_frames
from room2dgs.depth.completion import correction, evidence
from room2dgs.depth.completion.correction import correction_by_network
from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.errors import InputError
from room2dgs.stereo.depth_samples import DepthSamples, with_depth_samples
from room2dgs.stereo.geometric_consistency import GeometricConsistency
from room2dgs.stereo.passes import StereoMap

SHAPE = (12, 16)


@pytest.fixture
def view(make):
    """A camera that looks along the world's x, at depths between 1 and 2 m but for one pixel."""
    random = np.random.default_rng(0)
    camera = make.camera_at((1.0, 2.0, 3.0), (1.0, 0, 0), pixels=16, half_angle_deg=30).resized(16, 12)

    def some(least: float = 0.0) -> np.ndarray:
        return random.uniform(least, least + 1, SHAPE).astype(np.float32)

    depth, sample, prior = some(1), some(1), some(1)
    depth[2, 3] = 0
    sample[4, 5], prior[6, 7] = 0, 9
    photo, normal = random.random((*SHAPE, 3)), np.tile(-camera.forward, (*SHAPE, 1))
    maps = LowResInput(camera, photo, normal, sample, some(), prior, some(), (some(), some()), some(), (some(), some()))
    return maps, Completed(camera, sample, maps.sample_weight, some(), depth, some())


def test_each_channel_is_what_it_is_called(view):
    maps, small = view
    counts = [np.full(SHAPE, number, np.uint8) for number in (7, 2, 1)]
    said = GeometricConsistency(small.depth, *counts, small.depth)
    lent, planes = (2 * small.depth, np.full(SHAPE, 0.5)), (np.zeros(SHAPE), np.full(SHAPE, 0.7))
    error = np.full(SHAPE, 0.02)
    error[0, 0] = 5
    found = evidence.evidence(maps, small, said, np.full(SHAPE, 0.25), lent, planes, error)
    assert found.shape == (evidence.CHANNELS, *SHAPE) and found.dtype == np.float32 and np.isfinite(found).all()
    known = small.depth > 0
    np.testing.assert_allclose(
        np.exp(found[evidence.LN_DEPTH] + found[evidence.LN_MEDIAN])[known], small.depth[known], rtol=1e-5
    )
    assert (found[evidence.KNOWN] == known).all()
    assert np.median(found[evidence.LN_DEPTH][known]) == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(np.moveaxis(found[evidence.PHOTO : evidence.PHOTO + 3], 0, 2), maps.photo, rtol=1e-6)
    both = known & (maps.sample > 0)
    np.testing.assert_allclose(
        found[evidence.SAMPLE][both], np.log(maps.sample[both] / small.depth[both]).clip(-0.5, 0.5), atol=1e-5
    )
    assert found[evidence.SAMPLE_WEIGHT, 4, 5] == 0 == found[evidence.SAMPLE, 4, 5]
    assert (
        found[evidence.PRIOR, 6, 7] == evidence.MOST and (found[evidence.PRIOR : evidence.SAMPLE + 1, 2, 3] == 0).all()
    )
    # a wall that faces the camera, in the camera's frame
    np.testing.assert_allclose(found[evidence.NORMAL : evidence.NORMAL + 3, 0, 0], [0, 0, -1], atol=1e-6)
    assert [found[channel, 1, 1] for channel in (evidence.CONSISTENT, evidence.THROUGH, evidence.HIDDEN)] == [
        pytest.approx(part) for part in (0.7, 0.2, 0.1)
    ]
    assert found[evidence.OTHERS][known] == pytest.approx(evidence.MOST) and found[evidence.OTHERS_WEIGHT, 0, 0] == 0.5
    assert (found[evidence.PLANE] == 0).all() and (found[evidence.PLANE_WEIGHT] == 0).all()
    assert found[evidence.ERROR, 0, 0] == np.float32(evidence.MOST_ERROR)
    rays = maps.camera.rays()
    np.testing.assert_allclose(found[evidence.RAYS], rays[..., 0], rtol=1e-5)
    np.testing.assert_allclose(found[evidence.RAYS + 1], rays[..., 1], rtol=1e-5)


def test_a_view_without_any_depth_has_evidence_of_nothing(view):
    maps, small = view
    nothing = small._replace(depth=np.zeros(SHAPE, np.float32))
    said = GeometricConsistency(*(np.zeros(SHAPE, np.uint8) for _ in range(5)))
    none = (np.zeros(SHAPE), np.zeros(SHAPE))
    found = evidence.evidence(maps, nothing, said, np.zeros(SHAPE), none, none, np.full(SHAPE, np.float32(0.1)))
    assert np.isfinite(found).all() and not found[evidence.LN_DEPTH : evidence.SAMPLE + 1].any()


def photographed(room, folder):
    """The frames, with grey photos on disk."""
    frames = [replace(frame, color_path=folder / frame.color_path.name) for frame in room.frames]
    for frame, depth in zip(frames, room.depths, strict=True):
        cv2.imwrite(str(frame.color_path), np.full((*depth.shape, 3), 90, np.uint8))
    return frames


@pytest.fixture
def completed(room, tmp_path, complete_views):
    """Depth and weight of the views of a box room, by what corrects them."""
    frames = photographed(room, tmp_path)
    depths = {frame.name: depth.astype(np.float32) for frame, depth in zip(frames, room.depths, strict=True)}
    normals = {frame.name: normal.astype(np.float32) for frame, normal in zip(frames, room.normals, strict=True)}

    def complete(correct, stereo=False):
        maps = consistent(depths) if stereo else {}
        cameras = [frame.camera for frame in frames]
        points = with_depth_samples(room.points, frames, cameras, maps) if stereo else room.points
        return complete_views(frames, depths, normals, points, stereo=maps, correct=correct)

    return complete


def consistent(depths):
    """Stereo's maps of these depths, with which seven views are consistent."""
    return {name: StereoMap(depth, np.full(depth.shape, 7, np.uint8)) for name, depth in depths.items()}


def test_depth_moves_as_the_network_says_and_is_trusted_by_its_expected_error(completed):
    names = []

    def correct(name, found):
        names.append(name)
        return np.full(found.shape[1:], np.log(1.1), np.float32), np.full(found.shape[1:], 0.04, np.float32)

    plain, corrected = completed(None), completed(correct)
    assert sorted(names) == sorted(plain) and len(plain) > 1
    for name, (depth, sure) in corrected.items():
        known = plain[name][0] > 0
        np.testing.assert_allclose(depth[known], 1.1 * plain[name][0][known], rtol=1e-4)
        np.testing.assert_allclose(sure[known], completed_weight(np.float32(0.04)), rtol=1e-4)


def test_planes_are_found_anew_in_corrected_depth_by_half_the_width(completed, monkeypatch):
    asked = []

    def find(samples, **settings):
        asked.append(settings)
        return []

    monkeypatch.setattr("room2dgs.depth.completion.room_planes.find_planes", find)
    completed(lambda name, found: (np.zeros(found.shape[1:], np.float32), np.full(found.shape[1:], 0.01, np.float32)))
    assert [one["width"] for one in asked] == [1, 1, 0.5] and all(one["right_angles"] for one in asked)
    asked.clear()
    completed(None)
    assert [one["width"] for one in asked] == [1, 1]


def test_the_shipped_network_leaves_depth_that_stereo_confirms_nearly_as_it_is(completed):
    plain, corrected = completed(None, stereo=True), completed(correction_by_network(), stereo=True)
    off = np.concatenate([np.abs(corrected[name][0] / np.maximum(plain[name][0], 1e-6) - 1).ravel() for name in plain])
    assert np.median(off) < 0.01 and np.mean(off > 0.05) < 0.1


def test_the_shipped_network_takes_any_size_and_any_number_of_threads():
    correct = correction_by_network()
    random = np.random.default_rng(0)
    views = [
        0.2 * random.standard_normal((evidence.CHANNELS, *size)).astype(np.float32)
        for size in ((90, 160), (213, 120), (7, 5))
    ] * 2
    alone = [correct("", one) for one in views]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(partial(correct, ""), views))
    for one, (shift, error), (again, error_again) in zip(views, alone, together, strict=True):
        assert shift.shape == error.shape == one.shape[1:] and (error > 0).all() and shift.any()
        assert (shift == again).all() and (error == error_again).all()


def test_a_network_that_is_missing_is_named_with_the_way_out(monkeypatch):
    monkeypatch.setattr(correction, "NAME", "gone.onnx")
    with pytest.raises(InputError, match=r"gone\.onnx is missing.*prior\.depth\.correction=false"):
        correction_by_network()


@pytest.mark.parametrize(("settings", "asked"), [({}, True), ({"depth__correction": False}, False)])
def test_it_corrects_both_passes_where_stereo_has_seen_something(
    room, prior_config, map_files, tmp_path, settings, asked, monkeypatch
):
    frames = photographed(room, tmp_path)
    folder = map_files(depth=lambda depth, i: 1.02 * depth)
    paths = {"depth__path": folder / "depth", "normal__path": folder / "normal"}
    config = prior_config("prior=files", **{"depth__correction": True, **paths, **settings})
    maps = consistent({f.name: d.astype(np.float32) for f, d in zip(frames, room.depths, strict=True)})
    calls = []

    def correct(name, found):
        calls.append(name)
        return np.zeros(found.shape[1:], np.float32), np.full(found.shape[1:], 0.01, np.float32)

    monkeypatch.setattr("room2dgs.depth.completion.stages.correction_by_network", lambda: correct)
    cameras = [frame.camera for frame in frames]
    held = DepthSamples(with_depth_samples(room.points, frames, cameras, maps), maps)
    depth_of_frames(frames, room.points, config, lambda line: None, lambda first: held)
    assert len(calls) == (2 * len(frames) if asked else 0)
    calls.clear()
    depth_of_frames(frames, room.points, config, lambda line: None)  # stereo is off
    assert not calls
