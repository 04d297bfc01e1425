"""conf/export: results in the files of other programs."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int
from room2dgs.config.names import QuickFormatName


@dataclass(config=GROUP)
class ExportConfig:
    """What other programs are given."""

    after_run: list[QuickFormatName] = Field(
        description="what every run writes at its end, each in about a second; []: nothing"
    )
    up: Literal["auto", "keep", "x", "y", "z", "-x", "-y", "-z"] = Field(
        description="auto: found | an axis of the world | keep: nothing is turned to what the file's readers expect"
    )
    faces: Int | None = Field(ge=100, description="simplify meshes to this many faces (null: as max_error_m has it)")
    max_error_m: Float | None = Field(
        gt=0, description="simplify meshes as far as 99.9 % stay this close to the whole one (null: as faces has it)"
    )
    texture_px: Int = Field(ge=256, le=8192, description="side of the textured mesh's picture")
    texture_faces: Int = Field(ge=100, le=200000, description="of the textured mesh, unless faces is given")
