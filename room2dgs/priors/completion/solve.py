"""One view's depth between anchors: it keeps the prior's slopes, passes through the anchors, and breaks at edges.

Unknown is r, the logarithm of completed over prior depth, on the pixels of a small image. Minimised is

    sum a (r - d)^2 + sum p r^2 + stiffness * sum over neighbours b (r_i - r_j)^2

with d the logarithm of anchor over prior depth. Anchors a, prior p and ties b are reweighted (Geman and McClure), since
some anchors are wrong, the prior is wrong where anchors say so, and surfaces end.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

REWEIGHTINGS = 3
STIFFNESS = 10.0
PRIOR_WEIGHT = 0.5
ANCHOR_WIDTH = 0.03  # relative error at which an anchor, or the prior, starts to count as wrong
TIE_WIDTH = 0.01  # difference of r between neighbours at which a tie starts to break
JUMP_WIDTH = 0.04  # likewise of the prior's slope and the one that its normals would have
WEAKEST_TIE = 0.01
LEAST = 1e-7  # keeps the system regular where nothing is known


def completed(
    anchor: np.ndarray,
    trust: np.ndarray,
    prior: np.ndarray,
    prior_weight: np.ndarray,
    slopes: tuple[np.ndarray, np.ndarray],
    tie: np.ndarray,
) -> np.ndarray:
    """ln of completed over prior depth.

    Args:
        anchor: (h, w) metres, 0 = none.
        trust: (h, w) of each anchor, 0..1.
        prior: (h, w) metres, 0 = invalid.
        prior_weight: (h, w) confidence in the prior, 0..1.
        slopes: (h, w) each, d ln z / dx and d ln z / dy a pixel, of the normals; NaN where there is none.
        tie: (h, w) confidence in the slopes, 0..1.

    Returns:
        (h, w) float64; 0 where the prior is invalid.
    """
    known = prior > 0
    log_prior = np.log(np.where(known, prior, 1.0))
    anchored = (anchor > 0) & known
    distance = np.where(anchored, np.log(np.where(anchored, anchor, 1.0)) - log_prior, 0.0)
    right = _ties(log_prior, known, slopes[0], tie)
    down = _ties(log_prior.T, known.T, slopes[1].T, tie.T).T
    r = np.zeros(prior.shape)
    anchor_share, prior_share = np.ones(prior.shape), np.ones(prior.shape)
    whole = [np.ones(right.shape), np.ones(down.shape)]
    for step in range(REWEIGHTINGS):
        if step:
            anchor_share = _share(r - distance, ANCHOR_WIDTH)
            prior_share = _share(r, ANCHOR_WIDTH)
            whole = [_share(np.diff(r, axis=axis), TIE_WIDTH) for axis in (1, 0)]
        data = anchored * trust * anchor_share
        pull = data + PRIOR_WEIGHT * prior_weight * known * prior_share + LEAST
        r = _solved(pull, data * distance, STIFFNESS * right * whole[0], STIFFNESS * down * whole[1])
    return np.where(known, r, 0.0)


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


def _ties(log_prior: np.ndarray, known: np.ndarray, slope: np.ndarray, tie: np.ndarray) -> np.ndarray:
    """(h, w - 1) stiffness between neighbours along x."""
    expected = 0.5 * (slope[:, :-1] + slope[:, 1:])
    jump = np.abs(np.diff(log_prior, axis=1) - np.nan_to_num(expected))
    sure = np.minimum(tie[:, :-1], tie[:, 1:]) * np.isfinite(expected) + WEAKEST_TIE
    return sure * _share(jump, JUMP_WIDTH) * (known[:, :-1] & known[:, 1:])


def _share(residual: np.ndarray, width: float) -> np.ndarray:
    return 1.0 / (1.0 + (residual / width) ** 2)


def _solved(pull: np.ndarray, target: np.ndarray, right: np.ndarray, down: np.ndarray) -> np.ndarray:
    height, width = pull.shape
    rightwards = np.zeros(pull.shape)
    rightwards[:, :-1] = right
    downwards = np.zeros(pull.shape)
    downwards[:-1] = down
    centre = pull + rightwards + downwards
    centre[:, 1:] += right
    centre[1:] += down
    x, y = rightwards.ravel()[:-1], downwards.ravel()[:-width]
    matrix = diags([centre.ravel(), -x, -x, -y, -y], [0, 1, -1, width, -width], format="csc")
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return factors.solve(target.ravel()).reshape(height, width)
