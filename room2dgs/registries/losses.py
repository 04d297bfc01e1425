"""The terms of the training loss, in the order in which they are computed and summed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.train.terms.term import LossTerm

LOSSES: Registry[LossTerm] = Registry("loss")
LOSSES.register("rgb", "room2dgs.train.terms.image:RGB", "L1 and D-SSIM of the rendered colour.")
LOSSES.register("distortion", "room2dgs.train.terms.image:DISTORTION", "Depth distortion along each ray.")
LOSSES.register(
    "normal_consistency",
    "room2dgs.train.terms.image:NORMAL_CONSISTENCY",
    "Rendered normals agree with those of the rendered depth.",
)
LOSSES.register("depth_prior", "room2dgs.train.terms.priors:DEPTH_PRIOR", "Rendered depth agrees with the prior's.")
LOSSES.register("normal_prior", "room2dgs.train.terms.priors:NORMAL_PRIOR", "Rendered normals agree with the prior's.")
LOSSES.register(
    "multiview_geometric",
    "room2dgs.train.terms.multiview:MULTIVIEW_GEOMETRIC",
    "Points projected into a neighbour view and back return to their pixel.",
)
LOSSES.register(
    "multiview_photometric",
    "room2dgs.train.terms.multiview:MULTIVIEW_PHOTOMETRIC",
    "Patches warped by the rendered plane look alike in a neighbour view.",
)
