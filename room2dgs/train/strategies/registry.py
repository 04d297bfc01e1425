"""The strategy that the settings name."""

from __future__ import annotations

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.registries.strategies import STRATEGIES
from room2dgs.train.strategies.strategy import Strategy


def new_strategy(config: Config, scene: Scene) -> Strategy:
    """The strategy `config.strategy.name` for a run on this capture."""
    return STRATEGIES.load(config.strategy.name)(config, scene)
