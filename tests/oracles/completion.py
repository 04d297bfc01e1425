"""The kernels' oracle: the same reweighted systems, each solved by scipy's sparse LU."""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from room2dgs.depth.completion.solve import LEAST, REWEIGHTINGS, SAMPLE_WIDTH, TIE_WIDTH, System, share


def solved_reference(system: System) -> np.ndarray:
    """r of one image, (h, w) float64."""
    r = _once(system)
    for _ in range(1, REWEIGHTINGS):
        r = _once(
            System(
                system.distance,
                system.sample_weight * share(r - system.distance, SAMPLE_WIDTH),
                system.prior_weight * share(r, SAMPLE_WIDTH),
                system.right * share(np.diff(r, axis=1) - system.step_right, TIE_WIDTH),
                system.down * share(np.diff(r, axis=0) - system.step_down, TIE_WIDTH),
                system.step_right,
                system.step_down,
            )
        )
    return r


def _once(system: System) -> np.ndarray:
    pull = system.sample_weight + system.prior_weight + LEAST
    target = system.sample_weight * system.distance
    for axis, pulled in ((1, system.right * system.step_right), (0, system.down * system.step_down)):
        target = target + _padded(pulled, axis, (1, 0)) - _padded(pulled, axis, (0, 1))
    return _solved(pull, target, system.right, system.down)


def _padded(values: np.ndarray, axis: int, by: tuple[int, int]) -> np.ndarray:
    return np.pad(values, [by if k == axis else (0, 0) for k in (0, 1)])


def _solved(pull: np.ndarray, target: np.ndarray, right: np.ndarray, down: np.ndarray) -> np.ndarray:
    height, width = pull.shape
    rightwards, downwards = np.zeros(pull.shape), np.zeros(pull.shape)
    rightwards[:, :-1], downwards[:-1] = right, down
    centre = pull + rightwards + downwards
    centre[:, 1:] += right
    centre[1:] += down
    x, y = rightwards.ravel()[:-1], downwards.ravel()[:-width]
    if height == 1 or width == 1:  # one diagonal, named once
        offsets, ties = [0, 1, -1], [centre.ravel(), *(2 * [-(x if height == 1 else y)])]
    else:
        offsets, ties = [0, 1, -1, width, -width], [centre.ravel(), -x, -x, -y, -y]
    symmetric = {"SymmetricMode": True}  # without it a whole image takes forty times as long
    factors = splu(
        diags(ties, offsets, format="csc"), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric
    )
    return factors.solve(target.ravel()).reshape(height, width)
