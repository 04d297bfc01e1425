"""The loss of one view: named terms, their weights, their sum."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor

from room2dgs.config import LossConfig
from room2dgs.losses.depth_prior import depth_prior_loss
from room2dgs.losses.normal_prior import normal_prior_loss
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import distortion, normal_consistency
from room2dgs.splat.types import Rendering
from room2dgs.train.schedule import is_active
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
# Every other row and column: a surfel covers many pixels, and the terms cost a quarter.
SPARSE = (slice(None, None, 2), slice(None, None, 2))
# Act on views that have the map of their name.
PRIOR_TERMS: dict[str, Callable[[Rendering, View], Tensor]] = {
    "depth_prior": lambda rendering, view: depth_prior_loss(
        rendering.depth[SPARSE], rendering.alpha[SPARSE], view.depth_prior[SPARSE], view.depth_prior_valid[SPARSE]
    ),
    "normal_prior": lambda rendering, view: normal_prior_loss(
        rendering.normal[SPARSE], rendering.alpha[SPARSE], view.normal_prior[SPARSE], view.normal_prior_valid[SPARSE]
    ),
}


def loss_terms(rendering: Rendering, target: Tensor, view: View, config: LossConfig, iteration: int) -> dict[str, Term]:
    """The terms that act on this view in this iteration, by name; "rgb" always does.

    Args:
        rendering: of `view`.
        target: (H, W, 3) float32 in 0..1.
    """
    terms = {"rgb": Term(1.0, rgb_loss(rendering.color, target, config.dssim))}
    for name, function in (SURFACE_TERMS | PRIOR_TERMS).items():
        if _acts(name, view, config, iteration):
            terms[name] = Term(getattr(config, name).weight, function(rendering, view))
    return terms


def needed_maps(view: View, config: LossConfig, iteration: int) -> dict[str, bool]:
    """Switches of `splat.render` for the outputs that cost time: only those that an active term reads."""
    return {
        "with_normal": any(_acts(name, view, config, iteration) for name in ("normal_consistency", "normal_prior")),
        "with_distortion": _acts("distortion", view, config, iteration),
    }


def _acts(name: str, view: View, config: LossConfig, iteration: int) -> bool:
    has_maps = name not in PRIOR_TERMS or getattr(view, name) is not None
    return has_maps and is_active(iteration, getattr(config, name))


def total_loss(terms: dict[str, Term]) -> Tensor:
    """Weighted sum (scalar)."""
    return sum(term.weight * term.value for term in terms.values())
