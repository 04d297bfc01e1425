"""`stereo`: dense depth from many photos."""

from __future__ import annotations

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, expert, public


@dataclass(config=GROUP)
class StereoConfig:
    """PatchMatch stereo and the consistency of views that keeps a pixel."""

    enabled: bool = public(True, "Whether multi-view stereo compares the photos and corrects the depth prior.")
    width: Int | None = public(
        640, "Width in pixels of the photos that stereo compares (null: the working size).", ge=16
    )
    num_source_views: Int = expert(8, "Number of source views that each view is compared with.", ge=1, le=32)
    top_k: Int = expert(4, "Number of best source views over which the cost of a plane is averaged.", ge=1, le=8)
    radius: Int = expert(4, "Radius of the compared windows in pixels; the second pass takes half of it.", ge=1, le=12)
    step: Int = expert(2, "Distance in pixels between the samples of a window.", ge=1, le=12)
    iterations: Int = expert(3, "Sweeps of the first search, at the smallest image size.", ge=1, le=100)
    rounds: Int = expert(
        1, "Searches at each image size in the first pass that also compare the depth of the source views.", ge=0, le=10
    )
    refinements: Int = expert(
        2, "Sweeps of each search that also compares the depth of the source views.", ge=1, le=100
    )
    consistency_views: Int = expert(10, "Number of views in which the consistency of a depth is checked.", ge=1, le=64)
    min_num_consistent: Int = expert(2, "Number of consistent views that a pixel needs to keep its depth.", ge=1, le=64)
    max_reprojection_px: Float = expert(1.0, "Largest reprojection error of a consistent view, in pixels.", gt=0, le=10)
    max_relative_difference: Float = expert(
        0.01, "Largest relative difference between the depths of a consistent view and of the pixel.", gt=0, le=1
    )
    max_cost: Float = expert(
        0.6,
        "Largest matching cost of a pixel that keeps its depth: 1 minus the correlation of the windows.",
        gt=0,
        le=2,
    )
    cell_m: Float = expert(
        0.01, "Side in metres of the cells of the fused point cloud, which hold one point each.", ge=1e-3, le=1
    )

    @model_validator(mode="after")
    def _window_is_small_enough(self) -> StereoConfig:
        if self.step > self.radius or (2 * (self.radius // self.step) + 1) ** 2 > 128:
            raise ValueError(
                f"stereo.radius={self.radius} with stereo.step={self.step} is impossible; "
                "give a window of 3 to 11 samples a side"
            )
        return self
