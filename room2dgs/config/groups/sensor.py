"""`prior.depth.sensor`: what the capture's own depth camera can do."""

from __future__ import annotations

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, expert


@dataclass(config=GROUP)
class SensorConfig:
    """Reach and noise of a depth camera; the defaults fit a Kinect and a phone's LiDAR."""

    min_m: Float = expert(0.2, "Smallest depth in metres that a depth camera measures.", ge=0, le=100)
    max_m: Float = expert(10.0, "Largest depth in metres that a depth camera measures.", ge=0.1, le=100)
    error_m: Float = expert(
        0.005, "Expected error in metres of a depth camera at no distance, for a surface that faces it.", ge=1e-6, le=1
    )
    error_per_m2: Float = expert(
        0.0025, "Expected error in metres that each square metre of distance adds to a depth camera's.", ge=0, le=1
    )

    @model_validator(mode="after")
    def _reaches(self) -> SensorConfig:
        if self.min_m >= self.max_m:
            raise ValueError(
                f"prior.depth.sensor.min_m={self.min_m} leaves no depth below prior.depth.sensor.max_m={self.max_m}; "
                "lower it"
            )
        return self
