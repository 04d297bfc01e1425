"""`train`: the optimisation."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, REQUIRED, Float, Int, Time, expert, group, public

Rate = Annotated[Float, Field(ge=0, le=1e3)]


@dataclass(config=GROUP)
class RatesConfig:
    """Adam's learning rates; `center` in metres for a scene of 1 m extent, as 2DGS has it."""

    center: Rate = expert(1.6e-4, "Learning rate of the surfels' centres, in metres for a scene of 1 m extent.")
    center_final: Rate = expert(1.6e-6, "Learning rate of the centres in the last iteration; it falls exponentially.")
    rotation: Rate = expert(1.0e-3, "Learning rate of the surfels' quaternions.")
    scale: Rate = expert(5.0e-3, "Learning rate of the numbers that give the surfels' scales.")
    opacity: Rate = expert(0.05, "Learning rate of the logits of opacity.")
    color: Rate = expert(2.5e-3, "Learning rate of colour of degree 0; higher degrees learn at a twentieth of it.")
    feature: Rate = expert(2.0e-2, "Learning rate of the seeds' features, which the shared decoder reads.")
    network: Rate = expert(5.0e-3, "Learning rate of the shared decoder's network.")
    network_final: Rate = expert(
        5.0e-4, "Learning rate of the shared decoder's network in the last iteration; it falls exponentially."
    )
    pose_rotation: Rate = expert(
        3.0e-4, "Learning rate of the rotations that train.refine_poses learns, in radians; it falls to a hundredth."
    )
    pose_center: Rate = expert(
        3.0e-4, "Learning rate of the positions that train.refine_poses learns, in metres; it falls to a hundredth."
    )

    @model_validator(mode="after")
    def _finals_can_be_reached(self) -> RatesConfig:
        for name in ("center", "network"):
            if getattr(self, name) > 0 and getattr(self, f"{name}_final") == 0:
                raise ValueError(f"{{key}}.{name}_final=0 cannot be reached exponentially; give a small positive rate")
        return self


@dataclass(config=GROUP)
class ResolutionConfig:
    """Image size during training: `fraction` of the full size until `until`, an iteration or a share of the run."""

    fraction: Float = expert(REQUIRED, "Share of the full image size.", gt=0, le=1)
    until: Time = expert(REQUIRED, "First iteration at the next size.")


@dataclass(config=GROUP)
class FloorConfig:
    """The opacity below which hits are skipped, until an iteration or a share of the run; then it is 1/255."""

    value: Float = expert(
        0.03125,  # 1/32
        "Opacity below which hits are skipped while surfels still move; a higher one is faster.",
        ge=1 / 255,
        le=0.5,
    )
    until: Time = expert(0.9, "First iteration in which only hits below 1/255 are skipped.")


@dataclass(config=GROUP)
class TrainConfig:
    """The optimisation."""

    iterations: Int = public(3000, "Steps of the optimiser; each renders one view.", ge=1)
    seed: Int = public(0, "Seed of everything that is random.")
    rates: RatesConfig = group(RatesConfig)
    refine_poses: bool = expert(False, "Whether training learns a small correction of each training view's pose.")
    random_background: bool = expert(  # docs/studies/mesh.md
        False,
        "Whether each training view is rendered over a colour of its own; over one colour for all, surfaces of that "
        "colour may become transparent.",
    )
    resolutions: list[ResolutionConfig] = expert(  # surfels still move far, and half-size photos are faster
        [ResolutionConfig(0.5, 0.7)],
        "Image sizes from coarse to fine and the iteration at which each ends; then training is at full size ([]: "
        "always).",
    )
    coarsest_px: Int = expert(
        320, "Smallest width in pixels to which train.resolutions shrinks the widest photo.", ge=1
    )
    opacity_floor: FloorConfig = group(FloorConfig)
    log_every: Int = expert(100, "Iterations between two lines of the log.", ge=1)
    test_every: Int = expert(1000, "Iterations between two evaluations of the held-out views (0: none).", ge=0)
    checkpoint_every: Int = expert(1000, "Iterations between two checkpoints.", ge=1)
    keep_checkpoints: Int = expert(2, "Number of newest checkpoints that are kept.", ge=1)
    viewer: bool = public(False, "Whether the run is shown in a browser while it trains (needs viser).")
    tensorboard: bool = expert(True, "Whether curves for TensorBoard are written.")

    @model_validator(mode="after")
    def _resolutions_rise(self) -> TrainConfig:
        previous: int | float = 0
        for level in self.resolutions:
            until = level.until * self.iterations if isinstance(level.until, float) else level.until
            if until <= previous:
                raise ValueError(f"train.resolutions needs rising `until`; until={level.until} breaks that")
            previous = until
        return self
