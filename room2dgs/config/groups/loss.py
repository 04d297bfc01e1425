"""conf/loss: the loss terms."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Time


@dataclass(config=GROUP)
class TermConfig:
    """A loss term's weight and when it acts; a time is an iteration (int) or a share of train.iterations (float)."""

    enabled: bool = Field(description="whether the term is used at all")
    weight: Float = Field(ge=0, description="its factor in the sum of the losses")
    start: Time = Field(description="first iteration")
    end: Time | None = Field(description="first iteration without it (null: never)")
    ramp: Time = Field(description="iterations until it has its full weight")


@dataclass(config=GROUP)
class MultiviewConfig:
    """What the multi-view terms compare: a view's pixels with a neighbouring view's (eq. 13-15)."""

    neighbours: Int = Field(ge=1, description="at most this many a view; one is drawn each iteration")
    max_angle_deg: Float = Field(ge=1, le=90, description="between the optical axes of neighbours")
    min_baseline_m: Float = Field(ge=1e-3, le=100, description="between their centres; nearer ones show no depth")
    max_baseline_m: Float = Field(ge=1e-3, le=100, description="between their centres")
    samples: Int = Field(ge=16, description="pixels compared each iteration")
    patch: Int = Field(ge=3, le=31, description="side of the compared patches, pixels, odd")
    min_std: Float = Field(
        ge=1e-3, le=0.5, description="patches of less contrast (grey levels of 0..1) are not compared"
    )

    @model_validator(mode="after")
    def _leaves_something_to_compare(self) -> MultiviewConfig:
        if self.patch % 2 == 0:
            raise ValueError(f"{{key}}.patch={self.patch} has no middle pixel; give an odd number")
        if self.max_baseline_m <= self.min_baseline_m:
            raise ValueError(
                f"{{key}}.max_baseline_m={self.max_baseline_m} leaves no neighbour; "
                f"give more than min_baseline_m={self.min_baseline_m}"
            )
        return self


@dataclass(config=GROUP)
class NormalReweightingConfig:
    """Normals that disagree with what is rendered lose weight as training goes on."""

    enabled: bool = Field(description="whether they do")
    start: Time = Field(description="first iteration")
    first_deg: Float = Field(ge=0.1, le=180, description="angle that quarters a pixel's weight in L_n, at the start")
    last_deg: Float = Field(ge=0.1, le=180, description="and in the last iteration, reached exponentially")


@dataclass(config=GROUP)
class LossConfig:
    """Loss terms; each has one toggle. A term acts on the views that have what it needs: a prior, a neighbour."""

    dssim: Float = Field(ge=0, le=1, description="L_rgb = (1 - dssim) L1 + dssim D-SSIM")
    distortion: TermConfig = Field()
    normal_consistency: TermConfig = Field()
    depth_prior: TermConfig = Field()
    depth_refit: bool = Field(
        description="the paper's scale and shift of each depth prior, fitted to the rendering in every iteration"
    )
    normal_prior: TermConfig = Field()
    normal_reweighting: NormalReweightingConfig = Field()
    multiview_geometric: TermConfig = Field()
    multiview_photometric: TermConfig = Field()
    multiview: MultiviewConfig = Field()
