"""The loss terms by name, in the order in which they are computed and summed."""

from __future__ import annotations

from room2dgs.train.terms.image import DISTORTION, NORMAL_CONSISTENCY, RGB
from room2dgs.train.terms.multiview import GEOMETRIC, MULTIVIEW_GEOMETRIC, MULTIVIEW_PHOTOMETRIC, PHOTOMETRIC
from room2dgs.train.terms.priors import DEPTH_PRIOR, NORMAL_PRIOR
from room2dgs.train.terms.term import LossTerm

LOSS_TERMS: dict[str, LossTerm] = {
    "rgb": RGB,
    "distortion": DISTORTION,
    "normal_consistency": NORMAL_CONSISTENCY,
    "depth_prior": DEPTH_PRIOR,
    "normal_prior": NORMAL_PRIOR,
    GEOMETRIC: MULTIVIEW_GEOMETRIC,
    PHOTOMETRIC: MULTIVIEW_PHOTOMETRIC,
}
