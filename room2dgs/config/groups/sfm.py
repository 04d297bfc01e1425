"""conf/sfm: the photos' poses."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Wants


@dataclass(config=GROUP)
class SfmConfig:
    """Whether the given poses are adjusted to the photos before anything uses them."""

    refine_poses: Annotated[Literal["auto"] | Annotated[bool, Strict()], Wants("auto, true or false")] = Field(
        description="bundle adjustment of the given poses; auto: kept where it clearly lowers reprojection errors"
    )
    leave_out: bool = Field(
        description="views whose poses photos do not tell take no part, if the given are clearly off and others see it"
    )
    refine_lens: bool = Field(
        description="with the poses, focal lengths and distortion, where photos clearly have others than given"
    )
