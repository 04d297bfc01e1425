"""How the number of primitives changes during training: the values of `strategy.name`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.captures.scene import Scene
    from room2dgs.config import Config
    from room2dgs.train.strategies.strategy import Strategy

# fact needs: the settings that it works with, by dotted name; without it any
STRATEGIES: Registry[Callable[[Config, Scene], Strategy]] = Registry("strategy")
_AT = "room2dgs.train.strategies"
STRATEGIES.register("fixed", f"{_AT}.strategy:fixed", "The seeds of the start are those of the end.")
STRATEGIES.register(
    "seeds", f"{_AT}.seeds:seed_strategy", "Seeds grow on a voxel hierarchy and are pruned, as in the paper."
)
STRATEGIES.register(
    "plain",
    f"{_AT}.plain:plain_strategy",
    "Single primitives are cloned, split and pruned, as 2DGS does.",
    needs={"seeds.per_seed": 1, "seeds.decoder": "explicit"},
)
STRATEGIES.register(
    "mcmc",
    f"{_AT}.mcmc:mcmc_strategy",
    "Transparent primitives move to opaque ones and noise explores, up to strategy.max_surfels, as 3DGS-MCMC does.",
    needs={"seeds.per_seed": 1, "seeds.decoder": "explicit"},
)
