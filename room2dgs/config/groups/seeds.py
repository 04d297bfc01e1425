"""`seeds`: seeds and their primitives."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Name, expert, public
from room2dgs.config.names import described
from room2dgs.registries.decoders import DECODERS


@dataclass(config=GROUP)
class SeedsConfig:
    """Seeds and the surfels they spawn (eq. 8-9)."""

    init: Literal["sfm", "sfm+depth", "points"] = public(
        "sfm+depth",
        "Where seeds start. sfm: in the voxels of the sparse points. sfm+depth: also on aligned prior depth where no "
        "point is. points: at every sparse point, as in 2DGS.",
    )
    voxel_m: Float = public(
        0.02, "Side in metres of the voxels that hold one seed each (the paper's delta).", ge=1e-4, le=10
    )
    depth_voxel_m: Float = expert(
        0.1, "Side in metres of the voxels that get one seed each from trusted prior depth.", ge=1e-3, le=10
    )
    beyond_m: Float = expert(
        0.0, "Metres by which seeds of prior depth go on where no photo looks, for views from elsewhere.", ge=0, le=10
    )
    # the paper has 10; fewer and larger surfels score the same (docs/studies/training.md)
    per_seed: Int = expert(4, "Number of surfels of a seed (the paper's k).", ge=1, le=64)
    neighbours: Int = expert(36, "Number of nearest points that give a seed its normal and scale.", ge=3, le=256)
    # with depth priors seeds lie on the surface from the start (docs/studies/training.md)
    opacity: Float = expert(0.6, "First opacity of surfels in a run with depth priors.", ge=0.005, le=0.99)
    faint_opacity: Float = expert(  # 2DGS's
        0.1, "First opacity of surfels in a run whose seeds are not placed by depth priors.", ge=0.005, le=0.99
    )
    max_scale_m: Float = expert(0.1, "Largest first scale of a surfel in metres.", ge=1e-4, le=10)
    decoder: Annotated[str, Name(DECODERS.names)] = expert(
        "explicit", described("How seeds become primitives.", DECODERS)
    )
    feature_size: Int = expert(32, "Size of the feature of a seed that the shared decoder reads.", ge=1, le=256)
    scale_activation: Literal["exp", "softplus"] = expert("exp", "Function that turns learnt numbers into scales.")
