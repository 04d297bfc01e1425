"""conf/train: the optimisation."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Time

Rate = Annotated[Float, Field(ge=0, le=1e3)]


@dataclass(config=GROUP)
class RatesConfig:
    """Adam's learning rates; `center` in metres for a scene of 1 m extent, as 2DGS has it."""

    center: Rate = Field(description="of the surfels' centres")
    center_final: Rate = Field(description="reached exponentially at the last iteration")
    rotation: Rate = Field(description="of the quaternions")
    scale: Rate = Field(description="of the learnt scale numbers")
    opacity: Rate = Field(description="of the logits")
    color: Rate = Field(description="SH degree 0; the higher degrees learn at a twentieth")
    feature: Rate = Field(description="shared decoder: each seed's feature")
    network: Rate = Field(description="shared decoder: its network")
    network_final: Rate = Field(description="reached exponentially at the last iteration")
    pose_rotation: Rate = Field(description="train.refine_poses: radians; falls to a hundredth")
    pose_center: Rate = Field(description="train.refine_poses: metres; falls to a hundredth")
    exposure: Rate = Field(description="train.exposure: of gains and offsets; falls to a hundredth")

    @model_validator(mode="after")
    def _finals_can_be_reached(self) -> RatesConfig:
        for name in ("center", "network"):
            if getattr(self, name) > 0 and getattr(self, f"{name}_final") == 0:
                raise ValueError(f"{{key}}.{name}_final=0 cannot be reached exponentially; give a small positive rate")
        return self


@dataclass(config=GROUP)
class ResolutionConfig:
    """Image size during training: `fraction` of the full size until `until`, an iteration or a share of the run."""

    fraction: Float = Field(gt=0, le=1)
    until: Time = Field()


@dataclass(config=GROUP)
class FloorConfig:
    """The opacity below which hits are skipped, until an iteration or a share of the run; then it is 1/255."""

    value: Float = Field(ge=1 / 255, le=0.5, description="the higher, the fewer pixels a surfel has, and the faster")
    until: Time = Field()


@dataclass(config=GROUP)
class TrainConfig:
    """The optimisation."""

    iterations: Int = Field(ge=1, description="steps of the optimiser, one view each")
    seed: Int = Field(description="of all that is random")
    rates: RatesConfig = Field()
    refine_poses: bool = Field(description="learn a small correction of each training view's pose")
    exposure: bool = Field(description="learn gains and offsets of each training photo's colours")
    random_background: bool = Field(
        description="render each training view over a colour of its own: over one colour for all, what has that colour "
        "may become transparent"
    )
    resolutions: list[ResolutionConfig] = Field(description="coarse to fine; after the last: full size ([]: always)")
    coarsest_px: Int = Field(ge=1, description="resolutions leave the widest photo this width, and enlarge none")
    opacity_floor: FloorConfig = Field()
    log_every: Int = Field(ge=1, description="iterations between two log lines")
    test_every: Int = Field(ge=0, description="iterations between two evaluations of the held-out views (0: none)")
    checkpoint_every: Int = Field(ge=1, description="iterations between two checkpoints")
    keep_checkpoints: Int = Field(ge=1, description="the last ones are kept")
    viewer: bool = Field(description="show the run in a browser on this machine while it trains (needs viser)")
    tensorboard: bool = Field(description="write curves for TensorBoard")

    @model_validator(mode="after")
    def _resolutions_rise(self) -> TrainConfig:
        previous = 0
        for level in self.resolutions:
            until = level.until * self.iterations if isinstance(level.until, float) else level.until
            if until <= previous:
                raise ValueError(f"train.resolutions needs rising `until`; until={level.until} breaks that")
            previous = until
        return self
