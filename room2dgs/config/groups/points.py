"""`points`: the sparse points."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, PathText, expert, public


@dataclass(config=GROUP)
class PointsConfig:
    """Sparse points from SfM with the known poses, or from a file."""

    source: Literal["auto", "sfm", "file"] = public(
        "auto",
        "Where sparse points come from. auto: the capture's own points if it has enough, else sfm. sfm: they are "
        "triangulated here. file: points.file.",
    )
    file: PathText | None = expert(None, "Point cloud (.ply) for points.source=file.")
    cache: PathText | None = expert(None, "Folder that keeps triangulated points (null: `points` in the run's folder).")
    max_features: Int = expert(8192, "Largest number of SIFT features of a photo.", ge=16)
    peak_threshold: Float = expert(
        0.003, "Smallest contrast of a SIFT feature; a lower one finds more on textureless walls.", ge=0, le=1
    )
    overlap: Int = expert(
        10, "Number of views that each view is matched with: half follow it, half are chosen by pose.", ge=1
    )
    min_track: Int = expert(3, "Smallest number of views of a sparse point.", ge=2)
    max_error_px: Float = expert(2.0, "Largest mean reprojection error of a sparse point, in pixels.", ge=1e-3)

    @model_validator(mode="after")
    def _file_is_given(self) -> PointsConfig:
        if self.source == "file" and not self.file:
            raise ValueError("points.source=file needs points.file=PATH of a .ply with points")
        return self
