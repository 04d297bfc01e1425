"""One phone: what all of its photos have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Phone:
    """Strengths of the effects of one phone, as cheap and dear ones have them.

    Attributes:
        vignette: share of the light that is lost in the corners.
        read, shot: noise's deviation in the dark, and its variance by light; linear, 1 = white.
        smear: noise reduction's strength, levels of 0..1 that count as noise.
        wash: pixels at 640 across over which colours are averaged.
        lift: exponent of the local tone mapping; 0 changes nothing.
        gamma, contrast, saturation: of the response; contrast bends the curve to an S.
        sharpening: share of the fine detail that is added once more; halo: likewise of coarser detail.
        jpeg_quality: 1 to 100.
        wander: share by which levels wander, both sides of the middle, of nine photos in ten.
        exposure_s: longest exposure, seconds; readout_s: from the first row to the last.
        breathing: largest change of the focal length, share.
    """

    vignette: float
    read: float
    shot: float
    smear: float
    wash: float
    lift: float
    gamma: float
    contrast: float
    saturation: float
    sharpening: float
    halo: float
    jpeg_quality: int
    wander: float = 0.25
    exposure_s: float = 0.03
    readout_s: float = 0.02
    breathing: float = 0.01


def random_phone(rng: np.random.Generator) -> Phone:
    """A phone of those that people have."""
    return Phone(
        vignette=float(rng.uniform(0.05, 0.35)),
        read=float(np.exp(rng.uniform(np.log(1e-3), np.log(6e-3)))),
        shot=float(np.exp(rng.uniform(np.log(1e-4), np.log(2e-3)))),
        smear=float(rng.uniform(0.01, 0.05)),
        wash=float(rng.uniform(1.0, 4.0)),
        lift=float(rng.uniform(0.1, 0.4)),
        gamma=float(rng.uniform(2.0, 2.4)),
        contrast=float(rng.uniform(0.0, 0.5)),
        saturation=float(rng.uniform(0.9, 1.35)),
        sharpening=float(rng.uniform(0.2, 1.0)),
        halo=float(rng.uniform(0.0, 0.25)),
        jpeg_quality=int(rng.integers(60, 93)),
    )
