"""`eval`: scores."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Name, PathText, expert, public
from room2dgs.registries.protocols import PROTOCOLS


@dataclass(config=GROUP)
class EvalConfig:
    """Scores against a ground truth."""

    protocols: list[Annotated[str, Name(PROTOCOLS.names)]] = public(
        ["area"], "Protocols by which a mesh is scored against the ground truth.", min_length=1
    )
    gt: PathText | None = public(None, "Mesh of the ground truth (null: the capture's own).")
    pred: PathText | None = expert(None, "Mesh that is scored (null: the mesh of the run).")
    threshold_m: Float = public(0.05, "Distance in metres below which precision and recall count a point.", ge=1e-4)
    samples: Int = expert(200_000, "Number of points that the protocol `area` samples on each mesh.", ge=100)
    seed: Int = expert(0, "Seed of the sampled points.")
    align: Literal["none", "cameras", "icp"] = public(
        "none",
        "How the mesh is aligned to the ground truth before it is scored. none: both are in one frame. cameras: by the "
        "similarity between the cameras of both captures. icp: by the surfaces.",
    )
    align_scene: PathText | None = expert(
        None, "Capture with the true poses of the same photos, for eval.align=cameras; photos are matched by name."
    )
    align_scale: bool = expert(True, "Whether the alignment may scale; otherwise it rotates and translates only.")
    image_metrics: bool = expert(True, "Whether renderings of the held-out views are scored against their photos.")
