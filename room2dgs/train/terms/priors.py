"""Terms of a rendering and what a prior predicts of its view's depth and normals."""

from __future__ import annotations

from torch import Tensor

from room2dgs.losses.depth_prior import depth_prior_loss
from room2dgs.losses.normal_prior import normal_prior_loss, reweighting
from room2dgs.splat.types import Rendering
from room2dgs.train.prior_maps import COMPARED, COMPARED_STEP
from room2dgs.train.schedule import reweighting_deg
from room2dgs.train.terms.term import LossTerm, TermContext
from room2dgs.train.views import View


def _depth_prior(rendering: Rendering, view: View, context: TermContext) -> Tensor:
    prior, confidence = view.maps.depth, view.maps.depth_confidence
    assert prior is not None and confidence is not None  # `applies`
    align = context.config.loss.depth_refit
    maps = (rendering.depth, rendering.alpha, prior, confidence > 0)
    return depth_prior_loss(*maps, align=align, confidence=confidence, step=COMPARED_STEP)


def _normal_prior(rendering: Rendering, view: View, context: TermContext) -> Tensor:
    prior, confidence = view.maps.normal, view.maps.normal_confidence
    assert prior is not None and confidence is not None  # `applies`
    valid = confidence > 0
    config = context.config
    width_deg = reweighting_deg(context.iteration, config.loss.normal_reweighting, config.train.iterations)
    if width_deg is not None:
        confidence = confidence * reweighting(rendering.normal[COMPARED], prior, width_deg)
    maps = (rendering.normal, rendering.alpha, prior, valid)
    return normal_prior_loss(*maps, confidence=confidence, step=COMPARED_STEP)


DEPTH_PRIOR = LossTerm(_depth_prior, applies=lambda view, pair: view.maps.depth is not None)
NORMAL_PRIOR = LossTerm(_normal_prior, reads=("normal",), applies=lambda view, pair: view.maps.normal is not None)
