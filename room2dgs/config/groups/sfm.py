"""`sfm`: the photos' poses."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Strict
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Wants, expert, public


@dataclass(config=GROUP)
class SfmConfig:
    """Whether the given poses are adjusted to the photos before anything uses them."""

    refine_poses: Annotated[Literal["auto"] | Annotated[bool, Strict()], Wants("auto, true or false")] = public(
        "auto",
        "Whether bundle adjustment refines the given poses. auto: where it clearly lowers the reprojection errors.",
    )
    leave_out: bool = expert(
        True,
        "Whether views are left out whose given poses are clearly wrong and cannot be refined; what they see must be "
        "in other views.",
    )
    refine_lens: bool = expert(
        True,
        "Whether bundle adjustment refines the focal length with the poses, and distortion where the photos clearly "
        "contradict a lens without.",
    )
