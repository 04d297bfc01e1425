"""The fit of calibrated consistency."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from scipy.special import expit

from room2dgs.tools.fit_consistency import Pixels, area, fitted, gathered, main, odds

TRUE = np.array([0.8, -0.4, 0.6, 0.2, -2.0, -1.0])


def drawn(count: int, seed: int, scale: float = 1.0) -> Pixels:
    """Pixels that are wrong as often as `TRUE` says."""
    rng = np.random.default_rng(seed)
    evidence = np.concatenate([rng.integers(0, 8, (count, 3)), rng.random((count, 2))], axis=1) * scale
    return Pixels(evidence, rng.random(count) < expit(TRUE[0] + evidence @ TRUE[1:]))


def test_weights_that_made_the_data_are_found_again():
    np.testing.assert_allclose(fitted([drawn(200_000, 0)], 5), TRUE, atol=0.05)


def test_captures_count_the_same_however_large():
    one, other = drawn(2000, 0), Pixels(drawn(2000, 1).evidence, drawn(2000, 2).wrong)
    larger = Pixels(np.tile(one.evidence, (5, 1)), np.tile(one.wrong, 5))
    np.testing.assert_allclose(fitted([one, other], 5), fitted([larger, other], 5), atol=1e-9)


def test_evidence_that_never_changes_is_no_obstacle():
    still = Pixels(np.zeros((100, 5)), np.arange(100) < 25)
    assert expit(fitted([still], 5)[0]) == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize(
    ("guess", "expected"), [([0, 1, 2, 3], 1.0), ([3, 2, 1, 0], 0.0), ([1, 1, 1, 1], 0.5), ([0, 2, 1, 3], 0.75)]
)
def test_the_area_is_how_often_wrong_ones_come_first(guess, expected):
    assert area(np.array(guess, float), np.array([False, False, True, True])) == expected


def test_odds_take_as_many_columns_as_there_are_weights():
    pixels = drawn(50, 3)
    np.testing.assert_allclose(odds([1.0, -0.5], pixels), 1 - 0.5 * pixels.evidence[:, 0])


def test_a_capture_gives_evidence_and_says_what_is_wrong(plain, tmp_path):
    pixels = gathered(plain.path, tmp_path)
    assert len(pixels.evidence) == len(pixels.wrong) > 1000
    assert (pixels.evidence[:, 0] >= 1).all()  # what no view is consistent with is not kept
    assert 0 < pixels.wrong.mean() < 0.5
    assert area(-pixels.evidence[:, 0], pixels.wrong) > 0.55


def test_a_capture_without_depth_is_refused(plain, tmp_path, capsys):
    shutil.copytree(plain.path, tmp_path / "bare", ignore=shutil.ignore_patterns("depth"))
    assert main([str(tmp_path / "bare")]) == 2
    assert "add a depth folder" in capsys.readouterr().err
