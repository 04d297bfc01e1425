"""`report`: the page that a run leaves."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Int, expert, public


@dataclass(config=GROUP)
class ReportConfig:
    """report.html; what bounds its size."""

    enabled: bool = public(True, "Whether a run writes report.html at its end.")
    faces: Int = expert(100_000, "Largest number of triangles of the mesh in the report.", ge=1000, le=300_000)
    max_surfels: Int = expert(
        120_000, "Largest number of surfels in the report; those that cover most are shown.", ge=0, le=300_000
    )
    views: Int = expert(
        6, "Number of held-out views in the report, and of training views with their photos.", ge=1, le=24
    )
