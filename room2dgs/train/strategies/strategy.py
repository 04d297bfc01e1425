"""Density control: what adds and removes seeds while training, and when."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from torch import Tensor

from room2dgs.config import Config, StrategyConfig
from room2dgs.train.model import Model
from room2dgs.train.schedule import at_iteration
from room2dgs.train.step import Step


@dataclass(frozen=True)
class Adjustment:
    """What an adjustment did: numbers of seeds by kind.

    Attributes:
        born, pruned: by kind, in the order in which they are told; zeros too.
        reset: all opacities were brought down.
    """

    born: dict[str, int] = field(default_factory=dict)
    pruned: dict[str, int] = field(default_factory=dict)
    reset: bool = False

    def line(self) -> str:
        """For the log, such as "born 12 (8 cm), 40 (2 cm); pruned 3 (transparent)"."""
        parts = []
        for verb, counts in (("born", self.born), ("pruned", self.pruned)):
            told = ", ".join(f"{count} ({kind})" for kind, count in counts.items() if count)
            parts += [f"{verb} {told}"] if told else []
        parts += ["opacities reset"] if self.reset else []
        return "; ".join(parts)

    def scalars(self) -> dict[str, float]:
        """For tensorboard, by tag."""
        groups = {"born": self.born, "pruned": self.pruned}
        return {f"seeds/{verb} {kind}": float(n) for verb, counts in groups.items() for kind, n in counts.items()}


class Strategy(Protocol):
    """Called by the loop around every iteration, as gsplat's strategies are.

    A strategy draws nothing that does not follow from (train.seed, iteration), and keeps what it has gathered as
    named tensors: a run that was killed and resumed gives the same bits.
    """

    def before_backward(self, iteration: int) -> bool:
        """Does it want this iteration's screen-space gradients? They cost time."""
        ...

    def after_backward(self, step: Step) -> None:
        """Take note of an iteration for which `before_backward` said yes."""
        ...

    def after_step(self, model: Model) -> Adjustment | None:
        """Change the model's seeds if it is time; `model.iteration` counts the iterations done."""
        ...

    def state(self) -> dict[str, Tensor]:
        """What was gathered since the last adjustment, for a checkpoint."""
        ...

    def load(self, state: dict[str, Tensor]) -> None:
        """The way back from `state`."""
        ...


class FixedStrategy:
    """The seeds stay as they are."""

    def before_backward(self, iteration: int) -> bool:
        return False

    def after_backward(self, step: Step) -> None:
        pass

    def after_step(self, model: Model) -> Adjustment | None:
        return None

    def state(self) -> dict[str, Tensor]:
        return {}

    def load(self, state: dict[str, Tensor]) -> None:
        pass


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


def new_strategy(config: Config, extent_m: float, views: int) -> Strategy:
    """The strategy that the settings name.

    Args:
        extent_m: `Scene.extent`.
        views: number of training views.
    """
    from room2dgs.train.strategies.plain import PlainStrategy
    from room2dgs.train.strategies.seeds import SeedStrategy

    if config.strategy.name == "seeds":
        return SeedStrategy(config, views)
    if config.strategy.name == "plain":
        return PlainStrategy(config, extent_m)
    return FixedStrategy()
