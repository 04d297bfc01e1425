"""conf/eval: scores."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, PathText
from room2dgs.config.names import ProtocolName, described
from room2dgs.registries.protocols import PROTOCOLS


@dataclass(config=GROUP)
class EvalConfig:
    """Scores against a ground truth."""

    protocols: list[ProtocolName] = Field(min_length=1, description=described("The protocols to score by.", PROTOCOLS))
    gt: PathText | None = Field(description="ground-truth mesh (null: the scene's)")
    pred: PathText | None = Field(description="mesh to score (null: the run's)")
    threshold_m: Float = Field(ge=1e-4, description="of precision, recall and F-score")
    samples: Int = Field(ge=100, description="area protocol: points a mesh")
    seed: Int = Field(description="of the samples")
    align: Literal["none", "cameras", "icp"] = Field(
        description="none: one frame | cameras: similarity from eval.align_scene's cameras | icp: of the surfaces"
    )
    align_scene: PathText | None = Field(
        description="capture with the true poses of the same photos (names, or their last numbers, tell which)"
    )
    align_scale: bool = Field(description="the alignment may scale; false: rotation and translation alone")
    image_metrics: bool = Field(description="score the held-out views against their photos")
