"""Terms of a rendering and its photo alone: colour, and the two regularisers of 2DGS."""

from __future__ import annotations

from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import distortion, normal_consistency
from room2dgs.train.terms.term import LossTerm

DEPTH_KIND = "expected"  # of the depth whose normals are compared: the median's gradient reaches one surfel a pixel

RGB = LossTerm(
    lambda rendering, view, context: rgb_loss(rendering.color, context.target, context.config.loss.dssim),
    weight=lambda config, iteration: 1.0,
)
DISTORTION = LossTerm(lambda rendering, view, context: distortion(rendering), reads=("distortion",))
NORMAL_CONSISTENCY = LossTerm(
    lambda rendering, view, context: normal_consistency(rendering, view.K, view.cam_from_world, DEPTH_KIND),
    reads=("normal",),
)
