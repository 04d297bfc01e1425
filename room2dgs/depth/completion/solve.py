"""One view's depth between samples: it has the normals' slopes, or the prior's, passes through the samples, and breaks
at edges.

Unknown is r, the logarithm of completed over prior depth, on the pixels at low resolution. Minimised is

    sum a (r - d)^2 + sum p r^2 + stiffness * sum over neighbours b (r_i - r_j - s_ij)^2

with d the logarithm of sample over prior depth, and s what the normals' slope has more than the prior's: walls of a
network's depth lean towards what frames them, those of its normals do not. Samples a, prior p and ties b are reweighted
(Geman and McClure), since some samples are wrong, the prior is wrong where samples say so, and surfaces end. Kernels
solve it directly, four images at a time (csrc/completion_kernels.cpp); tests/oracles/completion.py does it with scipy.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs import _C

REWEIGHTINGS = 3
STIFFNESS = 10.0
PRIOR_WEIGHT = 0.5
SAMPLE_WIDTH = 0.03  # relative error at which a sample, or the prior, starts to count as wrong
TIE_WIDTH = 0.01  # difference of r between neighbours at which a tie starts to break
JUMP_WIDTH = 0.04  # likewise of the prior's slope and the one that its normals would have
WEAKEST_TIE = 0.01
LEAST = 1e-7  # keeps the system regular where nothing is known


class System(NamedTuple):
    """What one image's r is solved from; float64.

    Attributes:
        distance: (h, w) d, 0 without sample.
        sample_weight, prior_weight: (h, w) a and p before any reweighting.
        right: (h, w - 1) stiffness times b between neighbours along x.
        down: (h - 1, w) likewise along y.
        step_right, step_down: likewise s, of the pixel to the right or below over the one itself.
    """

    distance: np.ndarray
    sample_weight: np.ndarray
    prior_weight: np.ndarray
    right: np.ndarray
    down: np.ndarray
    step_right: np.ndarray
    step_down: np.ndarray


def system(
    sample: np.ndarray,
    sample_weight: np.ndarray,
    prior: np.ndarray,
    prior_weight: np.ndarray,
    slopes: tuple[np.ndarray, np.ndarray],
    slope_weight: np.ndarray,
    edges: tuple[np.ndarray, np.ndarray],
    *,
    by_normals: bool,
) -> System:
    """Of one image.

    Args:
        sample: (h, w) metres, 0 = none.
        sample_weight: (h, w) of each sample, 0..1.
        prior: (h, w) metres, 0 = invalid; r is 0 there.
        prior_weight: (h, w) of the prior, 0..1.
        slopes: (h, w) each, d ln z / dx and d ln z / dy a pixel; NaN where there is none.
        slope_weight: (h, w) of the slopes, 0..1.
        edges: (h, w - 1) and (h - 1, w) what the photo leaves of the ties along x and y (`ties_across_edges`).
        by_normals: the slopes are those of normals; else the prior's, which it keeps.
    """
    known = prior > 0
    log_prior = np.log(np.where(known, prior, 1.0))
    sampled = (sample > 0) & known
    distance = np.where(sampled, np.log(np.where(sampled, sample, 1.0)) - log_prior, 0.0)
    right, step_right = _ties(log_prior, known, slopes[0], slope_weight)
    down, step_down = (one.T for one in _ties(log_prior.T, known.T, slopes[1].T, slope_weight.T))
    weights = sampled * sample_weight, PRIOR_WEIGHT * prior_weight * known
    ties = STIFFNESS * edges[0] * right, STIFFNESS * edges[1] * down
    steps = (step_right, step_down) if by_normals else (0 * step_right, 0 * step_down)
    return System(distance, *weights, *ties, *steps)


def solved(systems: Sequence[System]) -> list[np.ndarray]:
    """r of each image, (h, w) float64: ln of completed over prior depth.

    Each is its own; images of one size are solved together, which is faster.
    """
    results: list[np.ndarray] = [np.zeros(0)] * len(systems)
    by_shape: dict[tuple[int, ...], list[int]] = {}
    for index, one in enumerate(systems):
        by_shape.setdefault(one.distance.shape, []).append(index)
    for shape, alike in by_shape.items():
        some = System(
            *(np.array(part, np.float64, order="C") for part in zip(*(systems[k] for k in alike), strict=True))
        )
        r = np.empty((len(alike), *shape))
        ties = (some.right, some.down, some.step_right, some.step_down)
        _C.complete(
            some.distance, some.sample_weight, some.prior_weight, *ties, REWEIGHTINGS, LEAST, SAMPLE_WIDTH, TIE_WIDTH, r
        )
        for index, one in zip(alike, r, strict=True):
            results[index] = one
    return results


def normal_slopes(normal: np.ndarray, rays: np.ndarray, focal: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """d ln z / dx and d ln z / dy a pixel of planes with these normals; NaN where a normal is 0 or grazing.

    Args:
        normal: (h, w, 3) camera frame.
        rays: (h, w, 3) with z = 1.
        focal: pixels, along x and y.
    """
    across = (normal * rays).sum(axis=-1)
    usable = across < -0.08
    across = np.where(usable, across, np.nan)
    return -normal[..., 0] / focal[0] / across, -normal[..., 1] / focal[1] / across


def prior_slopes(prior: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Likewise, of the prior itself where nobody knows normals: it jumps where its slope changes.

    Args:
        prior: (h, w) metres, 0 = invalid.
    """
    log_prior = np.log(np.where(prior > 0, prior, np.nan))
    down, across = np.gradient(log_prior)
    return across, down


def _ties(
    log_prior: np.ndarray, known: np.ndarray, slope: np.ndarray, tie: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(h, w - 1) stiffness between neighbours along x, and the step of r that they are to make: none across a jump."""
    expected = 0.5 * (slope[:, :-1] + slope[:, 1:])
    given, both = np.isfinite(expected), known[:, :-1] & known[:, 1:]
    step = np.where(given, expected, 0) - np.diff(log_prior, axis=1)
    sure = np.minimum(tie[:, :-1], tie[:, 1:]) * given + WEAKEST_TIE
    smooth = share(step, JUMP_WIDTH)
    return sure * smooth * both, np.where(given & both, smooth * step, 0)


def share(residual: np.ndarray, width: float) -> np.ndarray:
    """What is left of a weight: 1 without a residual, 1/2 where it is as large as the width."""
    return 1.0 / (1.0 + (residual / width) ** 2)
