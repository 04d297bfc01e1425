"""conf/points: the sparse points."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, PathText


@dataclass(config=GROUP)
class PointsConfig:
    """Sparse points from SfM with the known poses, or from a file."""

    source: Literal["auto", "sfm", "file"] = Field(
        description="auto: the capture's own points where it has enough, else sfm | sfm: triangulated here | file"
    )
    file: PathText | None = Field(description="point file (.ply) for source=file")
    cache: PathText | None = Field(description="keeps triangulated points (null: points in the run's folder)")
    max_features: Int = Field(ge=16, description="SIFT features an image")
    peak_threshold: Float = Field(
        ge=0, le=1, description="weakest contrast of a feature; lower finds more on textureless walls"
    )
    overlap: Int = Field(ge=1, description="views a frame is matched with: half its successors, half chosen by pose")
    min_track: Int = Field(ge=2, description="drop points seen in fewer views")
    max_error_px: Float = Field(ge=1e-3, description="drop points with a larger mean reprojection error")

    @model_validator(mode="after")
    def _file_is_given(self) -> PointsConfig:
        if self.source == "file" and not self.file:
            raise ValueError("points.source=file needs points.file=PATH of a .ply with points")
        return self
