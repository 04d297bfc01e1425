"""`strategy`: how the number of primitives changes."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Name, Time, expert, public
from room2dgs.config.names import described
from room2dgs.registries.strategies import STRATEGIES


@dataclass(config=GROUP)
class StrategyConfig:
    """Densification and pruning; a time is an iteration (int) or a share of train.iterations (float)."""

    name: Annotated[str, Name(STRATEGIES.names)] = expert(
        "seeds", described("Rule by which primitives are added and pruned.", STRATEGIES)
    )
    # the paper's 1,500 and 15,000 of 30,000
    start: Time = expert(0.05, "First iteration in which primitives are added or pruned.")
    stop: Time = expert(0.5, "Last iteration in which primitives are added or pruned.")
    every: Int = expert(100, "Iterations between two densifications (the paper's N_g and N_alpha).", ge=1)
    # of the coarsest level; Scaffold-GS's 2e-4 trebles the surfels of this for +0.015 of F-score
    grow_gradient: Float = expert(
        8.0e-4, "Mean screen-space gradient above which primitives are added (the paper's theta_g).", ge=0
    )
    min_visits: Int = expert(
        3, "Iterations since the last densification in which strategy=seeds must have seen a surfel to count it.", ge=1
    )
    levels: Int = expert(
        3,
        "Levels of the voxel hierarchy of strategy=seeds; each is 4 times finer, down to seeds.voxel_m.",
        ge=1,
        le=8,
    )
    random_survival: bool = expert(
        False,
        "Whether strategy=seeds keeps only half of the new seeds of the coarsest level and 3/4 of the next level's.",
    )
    prune_opacity: Float = expert(
        0.005, "Opacity below which primitives are pruned (the paper's theta_alpha).", ge=0, le=1
    )
    thin: Float = expert(  # about a third of the surfels go (docs/studies/training.md)
        0.03,
        "Share of what all surfels add to the training views that pruning at strategy.stop removes, beginning with the "
        "surfels that add least.",
        ge=0,
        lt=1,
    )
    max_surfels: Int | None = public(
        None,
        "Number of surfels at which growth ends (null: no limit; with strategy=plain one for 16 pixels of the photos).",
        ge=1,
    )
    split_size: Float = expert(
        0.01,
        "Size above which strategy=plain splits a surfel instead of cloning it, as a share of the scene's extent.",
        ge=0,
    )
    prune_size: Float = expert(
        0.1,
        "Size above which strategy=plain prunes a surfel once opacities were reset, as a share of the scene's extent.",
        ge=0,
    )
    reset_every: Time = expert(
        0,
        "Iterations between resets of all opacities by strategy=plain (0: none), and from the last to growth's end.",
    )
