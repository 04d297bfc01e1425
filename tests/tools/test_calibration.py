"""`tools/calibration`: expected against true errors, where both are known."""

from __future__ import annotations

import json
import shutil

import cv2
import numpy as np
import pytest

from room2dgs.captures.uncertainty import completed_sigma, completed_weight
from room2dgs.tools.calibration.__main__ import main
from room2dgs.tools.calibration.bins import Errors, bins, calibration


def test_errors_of_the_expected_size_lie_within_it_as_often_as_a_deviation_says():
    generator = np.random.default_rng(0)
    expected = np.exp(generator.uniform(np.log(0.003), np.log(0.1), 200_000))
    true = np.abs(expected * generator.normal(size=len(expected)))
    half = len(expected) // 2
    parts = [Errors("a", "depth", expected[part], true[part], half) for part in (slice(half), slice(half, None))]
    found = calibration(parts)
    assert found.share == 1 and found.within == pytest.approx(0.683, abs=0.005)
    assert found.expected == pytest.approx(np.median(expected))
    assert sum(one.share for one in found.bins) == pytest.approx(1)
    for one in found.bins:
        assert one.low <= one.expected < one.high
        # |error| of a deviation s: 68 % are below s, half of them below 0.674 s
        assert one.p68 == pytest.approx(one.expected, rel=0.1)
        assert one.median == pytest.approx(0.674 * one.expected, rel=0.1)


def test_a_pixel_lies_in_the_bin_of_its_expected_error_and_not_of_its_true_one():
    first, second = bins(np.array([0.0, 1.0, 3.0, 3.0]), np.array([9.0, 9.0, 2.0, 4.0]), (0.0, 3.0, 8.0))
    assert (first.low, first.high, first.share, first.median) == (0.0, 3.0, 0.5, 9.0)
    assert (second.low, second.high, second.share, second.median) == (3.0, 8.0, 0.5, 3.0)


def test_pixels_that_a_source_lacks_lower_its_share():
    found = calibration(
        [Errors("a", "normal", None, np.array([1.0, 3.0]), 8), Errors("a", "normal", None, np.zeros(0), 2)]
    )
    assert found.share == 0.2 and found.median == 2 and found.expected is None and not found.bins
    assert calibration([Errors("a", "depth", None, np.zeros(0), 5)]) is None


def test_a_confidence_gives_back_its_error():
    error = np.array([0.001, 0.02, 0.3], np.float32)
    np.testing.assert_allclose(completed_sigma(completed_weight(error)), error, rtol=1e-3)


def test_the_command_measures_stereo_against_the_true_depth(wall, tmp_path, capsys):
    """The wall's depth is said to be 12 % more than it is: stereo's true error is that, whatever it expects."""
    folder, out = tmp_path / "wall", tmp_path / "out"
    shutil.copytree(wall, folder)
    (folder / "gt_mesh.ply").unlink()  # it would contradict the depth
    (folder / "depth").mkdir()
    for photo in (folder / "color").iterdir():
        height, width = cv2.imread(str(photo)).shape[:2]
        cv2.imwrite(str(folder / "depth" / f"{photo.stem}.png"), np.full((height, width), 2240, np.uint16))
    points = ["points.source=file", f"points.file={folder / 'points.ply'}", "prior=none"]
    assert main([str(folder), f"out={out}", *points]) == 0
    whole = json.loads((out / "calibration.json").read_text())
    depth, normal = whole["scenes"]["wall"]
    assert (depth["source"], depth["kind"]) == ("stereo", "depth") and 0.3 < depth["share"] <= 1
    assert depth["median"] == pytest.approx(0.12 / 1.12, abs=0.006)
    assert depth["within"] < 0.2 and sum(one["share"] for one in depth["bins"]) == pytest.approx(1)
    assert (normal["source"], normal["expected"], normal["bins"]) == ("stereo", None, [])
    assert normal["median"] < 15
    assert "bins of the expected error" in capsys.readouterr().out
    assert cv2.imread(str(out / "calibration.png")) is not None
    assert "| wall" in (out / "calibration.md").read_text()


def test_a_capture_without_depth_is_refused(wall, capsys):
    assert main([str(wall), "prior=none"]) == 2
    assert "add a depth folder" in capsys.readouterr().err
