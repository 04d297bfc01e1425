"""conf/stereo: dense depth from many photos."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int


@dataclass(config=GROUP)
class StereoConfig:
    """PatchMatch stereo and the agreement of views that keeps a pixel."""

    enabled: bool = Field(description="compare the photos, and hold the depth prior to what they say")
    width: Int | None = Field(ge=16, description="of the photos that are compared (null: the working size)")
    num_source_views: Int = Field(ge=1, le=32, description="views that a view is compared with")
    top_k: Int = Field(ge=1, le=8, description="the cost of a plane is its mean over this many views that like it most")
    radius: Int = Field(
        ge=1, le=12, description="of the compared windows, pixels; where photos are looked at twice, half of it"
    )
    step: Int = Field(ge=1, le=12, description="pixels between a window's samples")
    iterations: Int = Field(ge=1, le=100, description="sweeps of the first search, at the smallest image size")
    rounds: Int = Field(
        ge=0, le=10, description="of the first look: searches that also ask the other views' depth, at each image size"
    )
    refinements: Int = Field(ge=1, le=100, description="sweeps of each of them")
    consistency_views: Int = Field(ge=1, le=64, description="views that are asked whether they agree with a depth")
    min_num_consistent: Int = Field(ge=1, le=64, description="pixels that fewer of them agree with have no depth")
    max_reprojection_px: Float = Field(
        gt=0, le=10, description="a view agrees if its depth leads back to within this many pixels"
    )
    max_relative_difference: Float = Field(gt=0, le=1, description="and differs by a smaller share")
    max_cost: Float = Field(
        gt=0, le=2, description="pixels whose windows correlate less than 1 minus this have no depth"
    )
    cell_m: Float = Field(ge=1e-3, le=1, description="cells of the fused point cloud; one point each")

    @model_validator(mode="after")
    def _window_is_small_enough(self) -> StereoConfig:
        if self.step > self.radius or (2 * (self.radius // self.step) + 1) ** 2 > 128:
            raise ValueError(
                f"stereo.radius={self.radius} with stereo.step={self.step} is impossible; "
                "give a window of 3 to 11 samples a side"
            )
        return self
