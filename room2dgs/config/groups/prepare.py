"""conf/prepare: poses of photos that have none."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, PathText, Wants


@dataclass(config=GROUP)
class PrepareConfig:
    """Which photos or frames of a video, how they are matched, and where the metres come from."""

    video: PathText | None = Field(description="the video (short: video=FILE)")
    images: PathText | None = Field(description="folder of photos without poses (short: images=DIR)")
    depth: PathText | None = Field(
        description="folder of a sensor's depth maps: 16-bit PNG in millimetres, named as the photos, of their shape"
    )
    max_photos: Int = Field(ge=5, le=5000, description="use at most this many frames or photos")
    spacing: Float = Field(
        gt=0, le=0.5, description="what the picture moves from one frame to the next, as a share of its width"
    )
    max_side: Int = Field(ge=160, le=8192, description="frames of a video are kept at this longer side at most, pixels")
    lens: Literal["SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE"] = Field(
        description="COLMAP's camera model, estimated with the poses"
    )
    features: Int = Field(ge=100, le=50000, description="of each photo, at most")
    peak_threshold: Float = Field(gt=0, le=1, description="of SIFT: lower finds fainter features, as on plain walls")
    feature_side: Int = Field(ge=160, le=8192, description="they are searched at this longer side at most, pixels")
    exhaustive: Int = Field(ge=0, description="with at most this many photos each is matched with each")
    overlap: Int = Field(ge=1, le=100, description="with more: with so many that follow it, and some further ahead")
    loops: Int = Field(ge=0, le=100, description="and with so many others that look like it (loop closure)")
    length: Annotated[
        list[str] | None,
        Wants("[height,METRES] of the cameras, [PHOTO,PHOTO,METRES] between two, or [METRES] of their path"),
    ] = Field(
        min_length=1,
        max_length=3,
        description="known: [height,METRES] of the cameras, [PHOTO,PHOTO,METRES] between two, [METRES] of their path",
    )
    threads: Int | None = Field(
        ge=1,
        le=1024,
        description="of pycolmap (null: all cores that this process may use); photos are matched on one",
    )
