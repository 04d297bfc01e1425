"""conf/memory: what stays in memory."""

from __future__ import annotations

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float


@dataclass(config=GROUP)
class MemoryConfig:
    """What stays in memory; no result depends on it."""

    cache_mb: Float = Field(
        ge=0, description="10^6 bytes of photos and maps; the rest lies in the run's folder until the run ends"
    )
    gpu_mb: Float = Field(ge=0, description="render.device=cuda: 10^6 bytes of photos and maps that stay on the GPU")
