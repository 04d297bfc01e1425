"""`loss`: the terms of the training loss."""

from __future__ import annotations

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Time, expert, group, public


@dataclass(config=GROUP)
class TermConfig:
    """A loss term's weight and when it acts; a time is an iteration (int) or a share of train.iterations (float)."""

    enabled: bool = public(True, "Whether the loss has the {term} term.")
    weight: Float = public(1.0, "Weight of the {term} term.", ge=0)
    start: Time = expert(0, "First iteration with the {term} term.")
    end: Time | None = expert(None, "First iteration without the {term} term (null: it stays).")
    ramp: Time = expert(0, "Iterations in which the {term} term rises to its full weight.")


@dataclass(config=GROUP)
class MultiviewConfig:
    """What the multi-view terms compare: a view's pixels with a neighbour view's (eq. 13-15)."""

    neighbours: Int = expert(8, "Largest number of neighbour views of a view; each iteration draws one.", ge=1)
    max_angle_deg: Float = expert(30.0, "Largest angle between the optical axes of neighbour views.", ge=1, le=90)
    min_baseline_m: Float = expert(
        0.03, "Smallest distance between neighbour views, in metres; nearer views show no depth.", ge=1e-3, le=100
    )
    max_baseline_m: Float = expert(1.5, "Largest distance between neighbour views, in metres.", ge=1e-3, le=100)
    samples: Int = expert(1024, "Number of pixels that the multi-view terms compare each iteration.", ge=16)
    patch: Int = expert(
        7, "Side of the patches that the photometric term compares, in pixels; an odd number.", ge=3, le=31
    )
    min_std: Float = expert(
        0.01,
        "Patches with a smaller standard deviation of grey levels (0 to 1) are not compared.",
        ge=1e-3,
        le=0.5,
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
    """Prior normals that disagree with the rendered ones lose weight as training goes on."""

    enabled: bool = expert(False, "Whether prior normals that disagree with the rendered normals lose weight.")
    start: Time = expert(0.3, "First iteration in which prior normals lose weight.")
    first_deg: Float = expert(
        60.0, "Angle at which a prior normal has a quarter of its weight, in the first such iteration.", ge=0.1, le=180
    )
    last_deg: Float = expert(
        20.0,
        "Angle at which a prior normal has a quarter of its weight, in the last iteration; it falls exponentially.",
        ge=0.1,
        le=180,
    )


@dataclass(config=GROUP)
class LossConfig:
    """Loss terms; each has one toggle. A term acts on the views that have what it needs: a prior, a neighbour."""

    dssim: Float = public(0.2, "Share of D-SSIM in the colour loss: L_rgb = (1 - dssim) L1 + dssim D-SSIM.", ge=0, le=1)
    distortion: TermConfig = group(TermConfig, "depth distortion", enabled=False, weight=0.0, start=3000)
    normal_consistency: TermConfig = group(TermConfig, "normal consistency", weight=0.05, start=1000)
    depth_prior: TermConfig = group(TermConfig, "depth prior")
    depth_refit: bool = expert(  # depth is metric and consistent here, so it is off
        False,
        "Whether each depth prior is scaled and shifted to the rendered depth in every iteration, as in the paper.",
    )
    normal_prior: TermConfig = group(TermConfig, "normal prior")  # 0.01 L1 + 0.01 cosine, before its weight
    normal_reweighting: NormalReweightingConfig = group(NormalReweightingConfig)
    multiview_geometric: TermConfig = group(TermConfig, "geometric multi-view", enabled=False, weight=0.05, start=0.25)
    multiview_photometric: TermConfig = group(TermConfig, "photometric multi-view", weight=0.2, start=0.25)
    multiview: MultiviewConfig = group(MultiviewConfig)
