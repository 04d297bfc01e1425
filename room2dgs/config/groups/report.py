"""conf/report: the page that a run leaves."""

from __future__ import annotations

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Int


@dataclass(config=GROUP)
class ReportConfig:
    """report.html; what bounds its size."""

    enabled: bool = Field(description="write report.html at the end of a run")
    faces: Int = Field(ge=1000, le=300_000, description="at most so many triangles of the mesh")
    discs: Int = Field(ge=0, le=300_000, description="at most so many surfels, those that cover most")
    views: Int = Field(ge=1, le=24, description="held-out views, and as many training views, with their photos")
