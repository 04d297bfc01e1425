"""The loss of one view: named terms, their weights, their sum."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor

from room2dgs.config import Config
from room2dgs.losses.depth_prior import depth_prior_loss
from room2dgs.losses.normal_prior import doubt, normal_prior_loss
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import distortion, normal_consistency
from room2dgs.splat.types import Rendering
from room2dgs.train.multiview import GEOMETRIC, PHOTOMETRIC, multiview_terms
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.prior_maps import COMPARED
from room2dgs.train.schedule import doubt_deg, term_weight
from room2dgs.train.views import View


class Term(NamedTuple):
    """A loss term's weight and its unweighted value (scalar)."""

    weight: float
    value: Tensor


DEPTH_KIND = "expected"  # of the depth whose normals are compared: the median's gradient reaches one surfel a pixel
SURFACE_TERMS: dict[str, Callable[[Rendering, View], Tensor]] = {
    "distortion": lambda rendering, view: distortion(rendering),
    "normal_consistency": lambda rendering, view: normal_consistency(
        rendering, view.K, view.cam_from_world, DEPTH_KIND
    ),
}
PRIOR_TERMS = {"depth_prior": "depth", "normal_prior": "normal"}  # act on views that have this map
MULTIVIEW_TERMS = (GEOMETRIC, PHOTOMETRIC)  # act on views that have a neighbour


def loss_terms(rendering: Rendering, target: Tensor, view: View, config: Config, iteration: int) -> dict[str, Term]:
    """The terms of one view alone that act in this iteration, by name; "rgb" always does.

    Args:
        rendering: of `view`.
        target: (H, W, 3) float32 in 0..1.
    """
    weights = _weights(view, config, iteration)
    terms = {"rgb": Term(1.0, rgb_loss(rendering.color, target, config.loss.dssim))}
    doubted_deg = doubt_deg(iteration, config.loss.normal_reweighting, config.train.iterations)
    functions = SURFACE_TERMS | {
        "depth_prior": _depth_prior,
        "normal_prior": lambda rendering, view: _normal_prior(rendering, view, doubted_deg),
    }
    for name, function in functions.items():
        if name in weights:
            terms[name] = Term(weights[name], function(rendering, view))
    return terms


def multiview_loss_terms(
    rendering: Rendering, view: View, pair: Pair, config: Config, iteration: int
) -> dict[str, Term]:
    """The terms that compare a view with a neighbour, likewise."""
    weights = _weights(view, config, iteration, pair)
    names = [name for name in MULTIVIEW_TERMS if name in weights]
    values = multiview_terms(rendering, view, pair, config.loss.multiview, names)
    return {name: Term(weights[name], values[name]) for name in names}


def needed_maps(view: View, config: Config, iteration: int, pair: Pair | None = None) -> dict[str, bool]:
    """Switches of `splat.render` for the outputs that cost time: only those that an active term reads."""
    weights = _weights(view, config, iteration, pair)
    return {
        "with_normal": any(name in weights for name in ("normal_consistency", "normal_prior", PHOTOMETRIC)),
        "with_distortion": "distortion" in weights,
    }


def _depth_prior(rendering: Rendering, view: View) -> Tensor:
    depth, alpha = rendering.depth[COMPARED], rendering.alpha[COMPARED]
    confidence = view.maps.depth_confidence
    return depth_prior_loss(depth, alpha, view.maps.depth, confidence > 0, confidence=confidence)


def _normal_prior(rendering: Rendering, view: View, doubted_deg: float | None) -> Tensor:
    normal, alpha = rendering.normal[COMPARED], rendering.alpha[COMPARED]
    prior, confidence = view.maps.normal, view.maps.normal_confidence
    valid = confidence > 0
    if doubted_deg is not None:
        confidence = confidence * doubt(normal, prior, doubted_deg)
    return normal_prior_loss(normal, alpha, prior, valid, confidence=confidence)


def _weights(view: View, config: Config, iteration: int, pair: Pair | None = None) -> dict[str, float]:
    """Of the terms that act, beside "rgb"."""
    names = [*SURFACE_TERMS, *(name for name, kind in PRIOR_TERMS.items() if getattr(view.maps, kind) is not None)]
    names += MULTIVIEW_TERMS if pair else ()
    weights = {name: term_weight(iteration, getattr(config.loss, name), config.train.iterations) for name in names}
    return {name: weight for name, weight in weights.items() if weight > 0}


def total_loss(terms: dict[str, Term]) -> Tensor:
    """Weighted sum (scalar)."""
    return sum(term.weight * term.value for term in terms.values())
