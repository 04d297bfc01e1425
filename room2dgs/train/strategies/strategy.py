"""Densification and pruning: the interface of a strategy, what an adjustment did, and when one is due."""

from __future__ import annotations

from dataclasses import dataclass, field

from torch import Tensor

from room2dgs.captures.scene import Scene
from room2dgs.config import Config, StrategyConfig
from room2dgs.train.model import Model
from room2dgs.train.schedule import at_iteration
from room2dgs.train.step import Step


@dataclass(frozen=True)
class Adjustment:
    """What an adjustment did: numbers of seeds by kind.

    Attributes:
        added, pruned: by kind, in the order of the log; zeros too.
        reset: all opacities were brought down.
    """

    added: dict[str, int] = field(default_factory=dict)
    pruned: dict[str, int] = field(default_factory=dict)
    reset: bool = False

    def line(self) -> str:
        """For the log, such as "added 12 (8 cm), 40 (2 cm); pruned 3 (transparent)"."""
        parts = []
        for verb, counts in (("added", self.added), ("pruned", self.pruned)):
            kinds = ", ".join(f"{count} ({kind})" for kind, count in counts.items() if count)
            parts += [f"{verb} {kinds}"] if kinds else []
        parts += ["opacities reset"] if self.reset else []
        return "; ".join(parts) or "nothing added, nothing pruned"

    def scalars(self) -> dict[str, float]:
        """For tensorboard, by tag."""
        groups = {"added": self.added, "pruned": self.pruned}
        return {f"seeds/{verb} {kind}": float(n) for verb, counts in groups.items() for kind, n in counts.items()}


class Strategy:
    """Base of all strategies, called around every iteration; this one leaves the seeds as they are.

    A strategy draws nothing that does not follow from (train.seed, iteration), and keeps what it has gathered as
    named tensors: a run that was killed and resumed gives the same bits. It changes the model by the functions of
    `ops`, and what it needs to know of single primitives the model's `primitive` tells. A new one is a file beside
    this one and an entry in `registries.strategies`.
    """

    def before_backward(self, iteration: int) -> bool:
        """Does it want this iteration's screen-space gradients? They cost time."""
        return False

    def after_backward(self, step: Step) -> None:
        """Take note of an iteration for which `before_backward` said yes."""

    def add_gradients(self, model: Model) -> None:
        """Add costs of its own to the parameters' gradients, before the step of the optimiser."""

    def after_step(self, model: Model) -> Adjustment | None:
        """Change the model's seeds if it is time; `model.iteration` counts the iterations done."""
        return None

    def state(self) -> dict[str, Tensor]:
        """What was gathered since the last adjustment, for a checkpoint."""
        return {}

    def load(self, state: dict[str, Tensor]) -> None:
        """The way back from `state`."""


def fixed(config: Config, scene: Scene) -> Strategy:
    """strategy.name=fixed."""
    return Strategy()


@dataclass(frozen=True)
class Window:
    """Adjustments after `first`, `first` + `every`, ... and at most `last` iterations."""

    first: int
    last: int
    every: int

    def gathers(self, iteration: int) -> bool:
        """Does the iteration (from 0) count for an adjustment?"""
        return self.first - self.every <= iteration < self.last

    def due(self, done: int) -> bool:
        """Is there an adjustment after this many iterations?"""
        return self.first <= done <= self.last and (done - self.first) % self.every == 0


def window_of(config: StrategyConfig, iterations: int) -> Window:
    """The configured window in a run of `iterations`; the first adjustment has a whole interval behind it."""
    first = max(at_iteration(config.start, iterations), config.every)
    return Window(first, at_iteration(config.stop, iterations), config.every)
