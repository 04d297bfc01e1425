"""What a loss term is to training: a value, the maps it reads, and where and when it acts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from torch import Tensor

from room2dgs.config import Config
from room2dgs.splat.types import Rendering
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.schedule import term_weight
from room2dgs.train.views import View


@dataclass(frozen=True)
class TermContext:
    """What a term may need beside the rendering and its view.

    Attributes:
        config: of the run.
        iteration: from 0.
        target: (H, W, 3) float32 in 0..1, the view's photo.
        pair: the view with a neighbour, if it has one in this iteration.
        active: names of all terms that act in this iteration.
    """

    config: Config
    iteration: int
    target: Tensor
    pair: Pair | None
    active: tuple[str, ...]
    _shared: dict[str, Any] = field(default_factory=dict)

    def shared(self, key: str, compute: Callable[[], Any]) -> Any:
        """`compute()`, once in this iteration: for terms that have work in common."""
        if key not in self._shared:
            self._shared[key] = compute()
        return self._shared[key]


def always(view: View, pair: Pair | None) -> bool:
    """Of terms that act on every view."""
    return True


@dataclass(frozen=True)
class LossTerm:
    """What `registries.losses` names; the name there is also that of its settings, `config.loss.<name>`.

    Attributes:
        value: the unweighted loss (scalar) of a rendering of a view; differentiable in the rendering.
        reads: those of the maps "normal" and "distortion" that it needs; they are rendered only where one does.
        applies: does it act on such a view?
        stage: of the clock, to which its time is counted.
        weight: in an iteration of a run; None: the schedule in the term's settings.
    """

    value: Callable[[Rendering, View, TermContext], Tensor]
    reads: tuple[str, ...] = ()
    applies: Callable[[View, Pair | None], bool] = always
    stage: str = "loss"
    weight: Callable[[Config, int], float] | None = None

    def weight_at(self, name: str, config: Config, iteration: int) -> float:
        """0 where it does not act."""
        if self.weight:
            return self.weight(config, iteration)
        return term_weight(iteration, getattr(config.loss, name), config.train.iterations)
