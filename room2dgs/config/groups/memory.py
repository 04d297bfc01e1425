"""`memory`: what stays in memory."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, public


@dataclass(config=GROUP)
class MemoryConfig:
    """What stays in memory; no result depends on it."""

    cache_mb: Float = public(
        1500, "Memory for photos and maps, in 10^6 bytes; the rest lies in the run's folder until the run ends.", ge=0
    )
    gpu_mb: Float = public(
        4000, "Memory of the GPU for photos and maps, in 10^6 bytes, where render.device=cuda.", ge=0
    )
