"""conf/strategy: how the number of surfels changes."""

from __future__ import annotations

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Time
from room2dgs.config.names import StrategyName, described
from room2dgs.registries.strategies import STRATEGIES


@dataclass(config=GROUP)
class StrategyConfig:
    """Densification and pruning; a time is an iteration (int) or a share of train.iterations (float)."""

    name: StrategyName = Field(description=described("Decides which seeds are added and pruned.", STRATEGIES))
    start: Time = Field(description="of the adjustments")
    stop: Time = Field(description="of the adjustments")
    every: Int = Field(ge=1, description="iterations between two adjustments (the paper's N_g and N_alpha)")
    grow_gradient: Float = Field(ge=0, description="mean screen-space gradient that calls for growth (theta_g)")
    min_visits: Int = Field(
        ge=1, description="seeds: surfels seen in fewer iterations since the last adjustment have no say"
    )
    levels: Int = Field(
        ge=1,
        le=8,
        description="seeds: of the hierarchy; each is 4 times finer, the last has cells of seeds.voxel_m",
    )
    random_survival: bool = Field(description="seeds: of new seeds, half of the coarsest level's, 3/4 of the next, ...")
    prune_opacity: Float = Field(ge=0, le=1, description="less opaque ones go (theta_alpha)")
    thin: Float = Field(
        ge=0,
        lt=1,
        description="at `stop`, surfels that add least to the training views go, with this share of all they add",
    )
    max_surfels: Int | None = Field(ge=1, description="growth ends there, by falling gradient (null: never)")
    split_size: Float = Field(
        ge=0, description="plain: larger surfels split, others are cloned; a share of the scene's extent"
    )
    prune_size: Float = Field(
        ge=0, description="plain: larger surfels go once opacities were reset; a share of the extent"
    )
    reset_every: Time = Field(description="plain: iterations between two resets of all opacities (0: none)")
