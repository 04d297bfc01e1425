"""conf/scene: the capture."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Folder, Int, PathText


@dataclass(config=GROUP)
class SceneConfig:
    """Which frames of which capture, at which size."""

    path: Folder = Field(description="the capture's folder")
    layout: Literal["scannet"] = Field(description="scannet")
    frames: Int | None = Field(ge=3, description="use this many, evenly spaced (null: all)")
    stride: Int = Field(ge=1, description="use every n-th frame on disk")
    image_width: Int | None = Field(
        ge=16, le=8192, description="resize down to this width, keeping the aspect (null: as on disk)"
    )
    pixel_centres: Literal["integer", "half"] = Field(
        description="integer (ScanNet, OpenCV) | half: what cx, cy on disk count"
    )
    test_every: Int = Field(ge=0, description="every n-th used frame is held out (0: none)")
    gt_mesh: PathText | None = Field(description="null: gt_mesh.ply in the capture's folder, if there")
