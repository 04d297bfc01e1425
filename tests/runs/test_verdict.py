"""The verdict on a run: rules by tables of figures."""

from __future__ import annotations

from dataclasses import replace

import pytest

from room2dgs.runs.verdict import Measures, noted_verdict, verdict_of

# of a run that nothing is wrong with
SOUND = Measures(
    coverage=0.9,
    photo_agreement=0.9,
    psnr_db=22.0,
    nearest_psnr_db=12.0,
    stereo_coverage=0.55,
    points=1000,
    trusted=0.6,
    scale_ratio=1.5,
    left_out=0.0,
    prior_scale=0.9,
)


@pytest.mark.parametrize(
    ("figures", "word", "said"),
    [
        ({}, "good", ""),
        # half of what the cameras saw
        ({"coverage": 0.16}, "failed", "covers 16%"),
        ({"coverage": 0.49}, "failed", "covers 49%"),
        ({"coverage": 0.6}, "usable", "covers 60%"),
        # wrong poses or intrinsics
        ({"photo_agreement": 0.02}, "failed", "do not fit each other"),
        ({"photo_agreement": 0.6}, "usable", "do not fit each other"),
        ({"photo_agreement": 0.83}, "good", ""),
        # pictures: dark by themselves, or no better than another photo
        ({"psnr_db": 5.0, "nearest_psnr_db": 4.0}, "failed", "5.0 dB"),
        ({"psnr_db": 12.0, "nearest_psnr_db": 13.0}, "failed", "worse than their nearest photo"),
        ({"psnr_db": 14.0, "nearest_psnr_db": 11.0}, "usable", "14.0 dB"),
        ({"psnr_db": 19.0, "nearest_psnr_db": 25.0}, "good", ""),  # a video whose photos hardly differ
        # a bare floor
        ({"stereo_coverage": 0.33, "points": 39}, "usable", "stereo measured 33%"),
        ({"stereo_coverage": 0.33, "points": 2000}, "good", ""),
        ({"points_alone": True}, "usable", "joins sparse points"),
        ({"points_alone": False}, "good", ""),
        ({"trusted": 0.27}, "usable", "sure of"),
        # views that contradict each other
        ({"scale_ratio": 1.58 / 0.34}, "failed", "4.6 times between views"),
        ({"scale_ratio": 2.2}, "good", ""),
        ({"scale_ratio": 3.0}, "usable", "3.0 times between views"),
        # photos without a pose
        ({"left_out": 0.6}, "failed", "60% of the photos"),
        ({"left_out": 0.25}, "usable", "25% of the photos"),
        ({"prior_scale": 2.9}, "usable", "0.34 m by the depth network"),
        ({"prior_scale": 0.3}, "usable", "3.3 m by the depth network"),
    ],
)
def test_each_rule_speaks_of_its_own_figure(figures, word, said):
    verdict = verdict_of(replace(SOUND, **figures))
    assert verdict.word == word
    assert len(verdict.reasons) == len(verdict.advice) == (word != "good")
    assert said in " ".join(verdict.reasons)


def test_what_was_not_measured_is_held_against_nobody():
    assert verdict_of(Measures()).word == "good"
    assert verdict_of(Measures(coverage=0.9, psnr_db=22.0)).word == "good"


def test_the_worst_reason_decides_and_comes_first():
    verdict = verdict_of(replace(SOUND, coverage=0.6, left_out=0.2, scale_ratio=9.0))
    assert verdict.word == "failed" and verdict.failed
    assert "between views" in verdict.reasons[0] and len(verdict.reasons) == 3


def test_a_wrong_unit_is_the_advice_for_an_empty_mesh():
    verdict = verdict_of(replace(SOUND, coverage=0.16, prior_scale=5.0))
    assert verdict.failed
    assert verdict.advice == ("give scene.unit=0.2, the metres of one unit of the poses",)


def test_the_unit_that_was_given_is_corrected_by_what_the_network_finds():
    assert "scene.unit=0.02," in verdict_of(replace(SOUND, prior_scale=0.5 / 0.1, unit=0.1)).advice[0]


def test_a_verdict_is_read_as_it_was_noted():
    verdict = replace(verdict_of(replace(SOUND, coverage=0.16)), notes=("1 of 400 photos left out: 7",))
    assert verdict.lines()[-1] == "  note: 1 of 400 photos left out: 7"
    assert noted_verdict({"verdict": verdict.as_dict()}) == verdict
    assert noted_verdict({}) is None and noted_verdict({"verdict": None}) is None
    assert verdict.measures["coverage"] == 0.16
