"""How the number of primitives changes during training: the values of `strategy.name`."""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry

STRATEGIES: Registry[Any] = Registry("strategy")
STRATEGIES.register("fixed", "room2dgs.train.strategies.base:Strategy", "The number of surfels does not change.")
STRATEGIES.register("seeds", "room2dgs.train.strategies.seeds:SeedStrategy", "The paper's growth and pruning of seeds.")
STRATEGIES.register(
    "plain", "room2dgs.train.strategies.plain:PlainStrategy", "The densification of 2D Gaussian Splatting."
)
