"""conf/prior/depth: `sensor`, what the capture's own depth camera can do."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float


@dataclass(config=GROUP)
class SensorConfig:
    """Reach and noise of a depth camera."""

    min_m: Float = Field(ge=0, le=100, description="nearer depth is invalid")
    max_m: Float = Field(ge=0.1, le=100, description="farther depth is invalid")
    error_m: Float = Field(ge=1e-6, le=1, description="expected error of a surface that faces the camera, at 0 m")
    error_per_m2: Float = Field(ge=0, le=1, description="and what each square metre of distance adds, metres")

    @model_validator(mode="after")
    def _reaches(self) -> SensorConfig:
        if self.min_m >= self.max_m:
            raise ValueError(
                f"prior.depth.sensor.min_m={self.min_m} leaves no depth below prior.depth.sensor.max_m={self.max_m}; "
                "lower it"
            )
        return self
