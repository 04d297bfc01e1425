"""The strategies by the name that the settings give."""

from __future__ import annotations

from collections.abc import Callable

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.train.strategies.base import Strategy
from room2dgs.train.strategies.plain import PlainStrategy
from room2dgs.train.strategies.seeds import SeedStrategy

STRATEGIES: dict[str, Callable[[Config, Scene], Strategy]] = {
    "fixed": lambda config, scene: Strategy(),
    "seeds": lambda config, scene: SeedStrategy(config, len(scene.train)),
    "plain": lambda config, scene: PlainStrategy(config, scene.extent),
}


def new_strategy(config: Config, scene: Scene) -> Strategy:
    """The strategy `config.strategy.name` for a run on this capture."""
    return STRATEGIES[config.strategy.name](config, scene)
