"""The loss of one view: named terms, their weights, their sum."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor

from room2dgs.config import LossConfig
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


def loss_terms(rendering: Rendering, target: Tensor, view: View, config: LossConfig, iteration: int) -> dict[str, Term]:
    """The terms that act in this iteration, by name; "rgb" always does.

    Args:
        rendering: of `view`.
        target: (H, W, 3) float32 in 0..1.
    """
    terms = {"rgb": Term(1.0, rgb_loss(rendering.color, target, config.dssim))}
    for name, function in SURFACE_TERMS.items():
        toggle = getattr(config, name)
        if is_active(iteration, toggle):
            terms[name] = Term(toggle.weight, function(rendering, view))
    return terms


def needed_maps(config: LossConfig, iteration: int) -> dict[str, bool]:
    """Switches of `splat.render` for the outputs that cost time: only those that an active term reads."""
    return {
        "with_normal": is_active(iteration, config.normal_consistency),
        "with_distortion": is_active(iteration, config.distortion),
    }


def total_loss(terms: dict[str, Term]) -> Tensor:
    """Weighted sum (scalar)."""
    return sum(term.weight * term.value for term in terms.values())
