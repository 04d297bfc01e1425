"""Terms of a rendering and its photo alone: colour, and the two regularisers of 2DGS."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import distortion, normal_consistency
from room2dgs.splat.types import Rendering
from room2dgs.train.terms.term import LossTerm, TermContext
from room2dgs.train.views import View

DEPTH_KIND = "expected"  # of the depth whose normals are compared: the median's gradient reaches one surfel a pixel


def _rgb(rendering: Rendering, view: View, context: TermContext) -> Tensor:
    """Where a mask hides the photo, the rendering is compared with itself: no difference, no gradient."""
    color, target = view.exposed(rendering.color), context.target
    if view.mask is not None:
        hidden, itself = ~view.mask[..., None], color.detach()
        color, target = torch.where(hidden, itself, color), torch.where(hidden, itself, target)
    return rgb_loss(color, target, context.config.loss.dssim)


RGB = LossTerm(
    _rgb,
    weight=lambda config, iteration: 1.0,
)
DISTORTION = LossTerm(lambda rendering, view, context: distortion(rendering), reads=("distortion",))
NORMAL_CONSISTENCY = LossTerm(
    lambda rendering, view, context: normal_consistency(rendering, view.K, view.cam_from_world, DEPTH_KIND),
    reads=("normal",),
)
