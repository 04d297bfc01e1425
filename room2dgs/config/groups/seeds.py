"""conf/seeds: seeds and their surfels."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int
from room2dgs.config.names import DecoderName, described
from room2dgs.registries.decoders import DECODERS


@dataclass(config=GROUP)
class SeedsConfig:
    """Seeds and the surfels they spawn (eq. 8-9)."""

    init: Literal["sfm", "sfm+depth", "points"] = Field(
        description="sfm: voxels of the sparse points | sfm+depth | points: every point, as plain 2DGS"
    )
    voxel_m: Float = Field(ge=1e-4, le=10, description="delta")
    depth_voxel_m: Float = Field(
        ge=1e-3, le=10, description="sfm+depth: one seed a cell where the depth prior is trusted enough and no point is"
    )
    per_seed: Int = Field(ge=1, le=64, description="k surfels a seed")
    neighbours: Int = Field(ge=3, le=256, description="points for the local normal and scale")
    opacity: Float = Field(
        ge=0.005, le=0.99, description="initial opacity of surfels where depth priors tell the surface"
    )
    faint_opacity: Float = Field(
        ge=0.005, le=0.99, description="the same of a run whose seeds no depth prior has placed"
    )
    max_scale_m: Float = Field(ge=1e-4, le=10, description="upper bound of the initial scale")
    decoder: DecoderName = Field(description=described("Turns seeds into primitives.", DECODERS))
    feature_size: Int = Field(ge=1, le=256, description="numbers a seed that the shared decoder's network reads")
    scale_activation: Literal["exp", "softplus"] = Field(
        description="exp | softplus: what the learnt scale numbers mean"
    )
