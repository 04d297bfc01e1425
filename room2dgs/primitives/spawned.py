"""Small discs on a surface, from which primitives of every kind start."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor


class Spawned(NamedTuple):
    """k discs for each of S seeds, activated; float32.

    Attributes:
        positions: (S, 3) the seeds, metres.
        offsets: (S, k, 3) metres from the seed (eq. 9: p = v + O).
        rotations: (S, k, 4) unit quaternions (w, x, y, z); the third axis is the surface's normal.
        scales: (S, k, 2) metres along the first two axes.
        opacities: (S, k).
        sh_dc: (S, k, 3) coefficient of degree 0.
    """

    positions: Tensor
    offsets: Tensor
    rotations: Tensor
    scales: Tensor
    opacities: Tensor
    sh_dc: Tensor
