"""The loss of one view: named terms, their weights, their sum."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple, cast

from torch import Tensor

from room2dgs.config import Config
from room2dgs.registries.losses import LOSSES
from room2dgs.splat.types import Rendering
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.progress import StageClock
from room2dgs.train.terms.term import LossTerm, TermContext
from room2dgs.train.views import View


class Term(NamedTuple):
    """A loss term's weight and its unweighted value (scalar)."""

    weight: float
    value: Tensor


@cache
def known_terms() -> dict[str, LossTerm]:
    """All terms by name, in the order of the registry."""
    return {name: LOSSES.load(name) for name in LOSSES.names()}


def loss_terms(
    rendering: Rendering,
    target: Tensor,
    view: View,
    config: Config,
    iteration: int,
    pair: Pair | None = None,
    clock: StageClock | None = None,
) -> dict[str, Term]:
    """The terms that act in this iteration, by name, in the order of the registry; "rgb" always does.

    Args:
        rendering: of `view`.
        target: (H, W, 3) float32 in 0..1.
        pair: the view with a neighbour, for the multi-view terms.
        clock: counts each term's time to its stage.
    """
    weights = _weights(view, config, iteration, pair)
    context = TermContext(config, iteration, target, pair, tuple(weights))
    terms = {}
    for name, weight in weights.items():
        term = known_terms()[name]
        terms[name] = Term(weight, term.value(rendering, view, context))
        if clock:
            clock.lap(term.stage)
    return terms


def needed_maps(view: View, config: Config, iteration: int, pair: Pair | None = None) -> dict[str, bool]:
    """Switches of `splat.render` for the outputs that cost time: only those that an active term reads."""
    read = {name for term in _weights(view, config, iteration, pair) for name in known_terms()[term].reads}
    return {"with_normal": "normal" in read, "with_distortion": "distortion" in read}


def total_loss(terms: dict[str, Term]) -> Tensor:
    """Weighted sum (scalar) of at least one term."""
    return cast(Tensor, sum(term.weight * term.value for term in terms.values()))


def _weights(view: View, config: Config, iteration: int, pair: Pair | None) -> dict[str, float]:
    """Of the terms that act."""
    possible = {name: term for name, term in known_terms().items() if term.applies(view, pair)}
    weights = {name: term.weight_at(name, config, iteration) for name, term in possible.items()}
    return {name: weight for name, weight in weights.items() if weight > 0}
