"""conf/scene: the capture."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Folder, Int, PathText
from room2dgs.config.names import LayoutName


@dataclass(config=GROUP)
class SceneConfig:
    """Which frames of which capture, at which size; and what its numbers mean, where its layout does not tell."""

    path: Folder = Field(description="the capture's folder, or the file that it is")
    layout: LayoutName = Field(description="auto: by the files' names; docs/reference/captures.md lists what is read")
    frames: Int | None = Field(ge=3, description="use this many, evenly spaced (null: all)")
    stride: Int = Field(ge=1, description="use every n-th frame on disk")
    keyframes: Float = Field(
        gt=0,
        le=1,
        description="share of the training photos, as different as can be, that depth and normals are found of; stereo "
        "compares them with the others, too",
    )
    image_width: Int | None = Field(
        ge=16, le=8192, description="resize down to this width, keeping the aspect (null: as on disk)"
    )
    intrinsics: list[Float] | None = Field(
        min_length=4, max_length=4, description="[fx,fy,cx,cy] in pixels of the photos (null: the capture's)"
    )
    pixel_centres: Literal["auto", "integer", "half"] = Field(
        description="auto: as the layout has it | integer (OpenCV) | half (COLMAP): what cx, cy on disk count"
    )
    poses: Literal[
        "auto",
        "camera_to_world_opencv",
        "camera_to_world_opengl",
        "world_to_camera_opencv",
        "world_to_camera_opengl",
    ] = Field(description="auto: as the layout has it; else what the poses on disk mean")
    unit: Float | None = Field(gt=0, description="metres of one unit of the poses (null: 1)")
    topics: list[str] | None = Field(
        description="topics of a ROS bag to read where it has several pictures, depths or poses (null: the only ones)"
    )
    pose_frame: str | None = Field(description="frame of ROS whose poses a topic tells that does not say it")
    split: Literal["capture", "every"] = Field(
        description="capture: its own test photos are held out, if it has such | every: every test_every-th"
    )
    test_every: Int = Field(ge=0, description="every n-th used frame is held out (0: none)")
    gt_mesh: PathText | None = Field(description="the true surface (null: what lies in the capture, if anything)")
