"""conf/render: the rasterizer."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Wants


@dataclass(config=GROUP)
class RenderConfig:
    """What a rendering is."""

    sh_degree: Int = Field(ge=0, le=3, description="0..3")
    sh_every: Int = Field(ge=1, description="iterations between two raises of the active degree")
    near_m: Float = Field(ge=1e-4, le=1, description="centres and hits nearer than this are not drawn")
    background: Annotated[list[Annotated[Float, Field(ge=0, le=1)]], Wants("three numbers from 0 to 1")] = Field(
        min_length=3, max_length=3, description="RGB in 0..1"
    )
    device: Literal["cpu", "cuda"] = Field(description="what trains, meshes and does stereo: cpu | cuda (an NVIDIA GPU)")
    threads: Int | None = Field(ge=1, le=1024, description="null: all cores that this process may use")
