"""Depth files of a capture as depth prior: chosen, told, used as they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.uncertainty import measured_weight
from room2dgs.depth import depth_of_frames
from room2dgs.depth.sensor.error import expected_error
from room2dgs.depth.sources.source import DepthSource, Proposal, SourceInput
from room2dgs.errors import InputError
from room2dgs.registries.depth_sources import DEPTH_SOURCES

AUTO = ("prior=auto", "prior/normal=none")
SENSOR = ("prior=none", "prior/depth=sensor")


@pytest.fixture
def load(room, prior_config):
    def run(frames, *choice, **changes):
        lines: list[str] = []
        priors = depth_of_frames(frames, room.points, prior_config(*(choice or SENSOR), **changes), lines.append)
        return priors, "\n".join(lines)

    return run


def test_depth_files_become_the_prior_as_they_are(with_depth, load, prior_config):
    frames = with_depth()
    priors, said = load(frames)
    settings = prior_config(*SENSOR).depth
    for frame in frames:
        maps = priors.by_frame[frame.name]
        on_disk = cv2.imread(str(frame.depth_path), cv2.IMREAD_UNCHANGED) * np.float32(1e-3)
        np.testing.assert_allclose(maps.depth, on_disk, rtol=1e-4)  # 16 bits in memory
        error = expected_error(on_disk, frame.camera, settings.sensor)
        weight = measured_weight(error / on_disk, settings.error_scale, settings.max_error)
        np.testing.assert_allclose(maps.depth_confidence, weight, atol=4e-3)
        fit = priors.fits[frame.name]
        assert (fit.scale, fit.shift) == (1.0, 0.0) and fit.residual < 0.01 and fit.points > 20
    assert priors.depth_source == "sensor" and priors.label == "sensor"
    assert "depth: sensor (6 of 6 photos)" in said and "prior/depth=room_prior uses the network alone" in said
    assert "WARNING" not in said


@pytest.fixture
def proposed(room, monkeypatch):
    """`proposed(frames, prior)`: what the source says; the network says nothing."""
    nothing = DepthSource(lambda given: Proposal(given.prior))
    monkeypatch.setattr("room2dgs.depth.sources.sensor.NETWORK", nothing)

    def run(frames, prior, log=print):
        given = SourceInput(frames, room.points, prior, {}, log)
        return DEPTH_SOURCES.load(prior.depth.source).depth(given)

    return run


def test_auto_is_the_sensor_with_depth_files_and_the_network_without(room, with_depth, prior_config, proposed):
    settings = prior_config(*AUTO)
    found = proposed(with_depth(), settings)
    chosen = found.prior.depth
    assert (chosen.source, chosen.align, chosen.joint) == ("sensor", False, False)
    assert len(found.measured) == len(room.frames)
    found = proposed(room.frames, settings)
    assert not found.measured and found.prior.depth == replace(settings.depth, source="room_prior")
    assert found.prior.depth == prior_config("prior=room_prior", "prior/normal=none").depth


def test_auto_takes_the_network_for_all_if_few_photos_have_depth(with_depth, prior_config, proposed):
    frames = with_depth(lambda depth, i: depth if i < 2 else None)
    lines: list[str] = []
    found = proposed(frames, prior_config(*AUTO), lines.append)
    assert not found.measured and found.prior.depth.source == "room_prior"
    assert any("2 of 6 photos" in line and "prior/depth=sensor uses it" in line for line in lines)
    found = proposed(frames, prior_config(*SENSOR), lines.append)
    assert found.prior.depth.source == "sensor" and list(found.measured) == [frame.name for frame in frames[:2]]


@pytest.mark.parametrize("source", ["none", "files"])
def test_any_other_source_measures_nothing(with_depth, prior_config, proposed, source):
    """The same files as maps of the user are only proposed, to be aligned."""
    frames = with_depth()
    settings = prior_config("prior=room_prior", depth__source=source, depth__path=frames[0].depth_path.parent)
    found = proposed(frames, settings)
    assert found.prior == settings and not found.measured and not found.sigmas
    assert len(found.raw) == (len(frames) if source == "files" else 0)


def test_missing_damaged_and_empty_files_are_told_and_the_others_used(with_depth, load):
    frames = with_depth(lambda depth, i: {0: None, 1: 0 * depth}.get(i, depth))
    whole = frames[2].depth_path.read_bytes()
    frames[2].depth_path.write_bytes(whole[: len(whole) // 2])
    priors, said = load(frames)
    assert set(priors.by_frame) == {frame.name for frame in frames[3:]}
    assert "1 of 6 photos have no depth file: 000000" in said
    assert f"{frames[1].depth_path} has no valid depth" in said and "1 more depth files: 000006" in said
    assert "depth: sensor (3 of 6 photos)" in said


def test_a_half_empty_map_counts_where_it_is_valid(room, with_depth, load):
    def half(depth, i):
        holes = depth.copy()
        holes[:, 40:] = 0
        return holes

    priors, _ = load(with_depth(half))
    maps = priors.by_frame[room.frames[0].name]
    assert not maps.depth[:, 40:].any() and not maps.depth_confidence[:, 40:].any()
    np.testing.assert_allclose(maps.depth[:, :40], room.depths[0][:, :40], atol=1e-3)


def test_depth_out_of_reach_is_no_depth(room, with_depth, load):
    priors, _ = load(with_depth(), depth__sensor__max_m=2.0)
    for frame, exact in zip(room.frames, room.depths, strict=True):
        depth = priors.by_frame[frame.name].depth
        assert depth.max() <= 2.0002
        np.testing.assert_array_equal(depth > 0, np.round(exact, 3) <= 2.0)
    with pytest.raises(InputError, match=r"prior\.depth\.sensor\.min_m=50 and max_m=60"):
        load(with_depth(), depth__sensor__min_m=50.0, depth__sensor__max_m=60.0)


def test_a_small_depth_map_is_resized_with_its_edges_kept(room, with_depth, load):
    def small_with_a_step(depth, i):
        near = np.full((30, 40), 1.0)
        near[:, 20:] = 3.0
        return near if i == 0 else depth

    priors, _ = load(with_depth(small_with_a_step))
    depth = priors.by_frame[room.frames[0].name].depth
    assert depth.shape == room.depths[0].shape
    assert set(np.round(np.unique(depth), 2)) == {1.0, 3.0}  # nothing in between


def test_a_depth_camera_of_its_own_is_seen_by_the_photo(room, with_depth, load):
    """As readers of other layouts give it: another field of view, another unit, a number for what is not known."""
    frame = room.frames[0]
    plane = np.full((20, 30), 4000, np.uint16)  # half millimetres
    plane[0] = 65535
    K = ((40.0, 0.0, 15.0), (0.0, 40.0, 10.0), (0.0, 0.0, 1.0))  # 41 degrees wide, the photo 67
    measured = DepthMap("flat", lambda: plane, 0.0005, K, invalid=65535)
    frames = [replace(frame, depth_path=Path("flat"), depth_map=measured), *with_depth()[1:]]
    priors, _ = load(frames)
    maps = priors.by_frame[frame.name]
    rays = frame.camera.rays()
    x, y = 40 * rays[..., 0] + 15, 40 * rays[..., 1] + 10
    inside = (x >= 0) & (x < 30) & (y >= 1) & (y < 20)  # the first row says nothing
    np.testing.assert_allclose(maps.depth, np.where(inside, 2.0, 0.0), rtol=1e-4)
    np.testing.assert_array_equal(maps.depth_confidence > 0, inside)


def test_no_usable_file_at_all(room, with_depth, load):
    with pytest.raises(InputError, match=r"no photo of the capture has a depth file.*prior/depth=room_prior"):
        load(with_depth(lambda depth, i: None))


@pytest.mark.parametrize("choice", [SENSOR, AUTO])
def test_metres_in_another_unit_stop_the_run_with_the_unit_that_fits(with_depth, load, choice):
    frames = with_depth(unit_m=1 / 5000)
    with pytest.raises(InputError, match=r"say 5 \(.*times the distances.*prior\.depth\.unit_m=0\.0002 \(now 0\.001\)"):
        load(frames, *choice)
    priors, _ = load(frames, *choice, depth__unit_m=0.0002)
    assert priors.depth_source == "sensor"


def test_a_unit_so_wrong_that_all_is_out_of_reach_is_a_unit_and_no_reach(with_depth, load):
    with pytest.raises(InputError, match=r"prior\.depth\.unit_m=0\.001 \(now 1\)"):
        load(with_depth(), depth__unit_m=1.0)


def test_a_map_that_lies_beside_its_photo_is_warned_about(with_depth, load):
    _, said = load(with_depth(lambda depth, i: np.roll(depth, 2, axis=1)))
    assert "WARNING: depth maps lie beside their photos: moved by (-2, +0) pixels of 80" in said
    assert "register depth to colour" in said


def test_the_depth_of_another_photo_weighs_less_and_is_named(room, with_depth, load):
    frames = with_depth(lambda depth, i: depth if i != 3 else room.depths[0][::-1] * 1.5)
    priors, said = load(frames)
    assert "WARNING: depth far off the sparse points of its own photo, it weighs less: 000009" in said
    strange, right = (priors.by_frame[frames[i].name].depth_confidence for i in (3, 2))
    assert np.median(strange) < 0.5 * np.median(right)
