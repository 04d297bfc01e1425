"""`render`: the rasterizer."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Wants, expert, public


@dataclass(config=GROUP)
class RenderConfig:
    """What a rendering is."""

    sh_degree: Int = expert(0, "Degree of the spherical harmonics of colour.", ge=0, le=3)
    sh_every: Int = expert(1000, "Iterations after which the degree of the spherical harmonics rises by one.", ge=1)
    near_m: Float = expert(0.05, "Distance in metres below which surfels and their hits are not drawn.", ge=1e-4, le=1)
    background: Annotated[list[Annotated[Float, Field(ge=0, le=1)]], Wants("three numbers from 0 to 1")] = expert(
        [0.0, 0.0, 0.0], "Colour behind everything, as RGB from 0 to 1.", min_length=3, max_length=3
    )
    device: Literal["cpu", "cuda"] = public(
        "cpu", "Device that trains, renders, fuses depth and does stereo. cuda: an NVIDIA GPU."
    )
    threads: Int | None = public(None, "Threads of the computation (null: all cores of the process).", ge=1, le=1024)
