"""conf/prior/*/: `onnx`, a network file and how it is fed."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, PathText, Wants

NETWORK_SOURCES = ("onnx", "room_prior")  # of priors: a network makes the maps


@dataclass(config=GROUP)
class OnnxConfig:
    """A depth or normal network in ONNX: what goes in and what comes out, as its maker documents it."""

    model: PathText | None = Field(
        description="the .onnx file (null: with source=room_prior the one that comes with room2dgs)"
    )
    get: str = Field(description="where that file comes from")
    sha256: Annotated[str | None, Wants("64 hexadecimal digits (SHA-256) or null")] = Field(
        pattern="^[0-9a-fA-F]{64}$", description="of that file (null: not checked)"
    )
    input: str | None = Field(description="the photo's input (null: the only one)")
    output: str | None = Field(description="the map's output (null: the only one)")
    mask: str | None = Field(description="output that is below 0.5 where the map is invalid (null: none)")
    error_output: str | None = Field(
        description="output: the network's expected error, of ln depth or in radians (null: none)"
    )
    error_scale: Float = Field(
        ge=1e-6, le=1e3, description="with that error a pixel weighs half: 1 / (1 + (error / error_scale)^2)"
    )
    max_error: Float = Field(ge=1e-6, le=1e6, description="pixels with more are invalid")
    flip: bool = Field(description="average with the prediction of the mirrored photo")
    intrinsics: str | None = Field(description="input for the 3x3 intrinsics in its own pixels (null: none)")
    tokens: str | None = Field(description="input for the number of patches of `multiple` pixels a side (null: none)")
    height: Int | None = Field(ge=1, le=8192, description="of the photo as the network sees it (null: the model's own)")
    width: Int | None = Field(ge=1, le=8192, description="likewise")
    multiple: Int = Field(ge=1, le=256, description="fit=cover: sides are multiples of this")
    fit: Literal["stretch", "pad", "cover"] = Field(
        description="stretch | pad (to height x width) | cover (keeps the aspect, no side smaller than that)"
    )
    layout: Literal["nchw", "nhwc"] = Field(description="nchw | nhwc")
    channels: Literal["rgb", "bgr"] = Field(description="rgb | bgr")
    white: Float = Field(ge=1e-3, le=65535, description="the photo's values are 0..white")
    mean: Annotated[list[Annotated[Float, Field(ge=-1e6, le=1e6)]], Wants("three numbers, one for each channel")] = (
        Field(min_length=3, max_length=3, description="taken off the values, each channel's own")
    )
    std: Annotated[
        list[Annotated[Float, Field(ge=1e-6, le=1e6)]], Wants("three positive numbers, one for each channel")
    ] = Field(min_length=3, max_length=3, description="what they are then divided by")
    output_channel: Int | None = Field(ge=0, le=255, description="depth: this channel of the output (null: it has one)")
    canonical_focal_px: Float | None = Field(
        ge=1, le=1e5, description="depth: metres for this focal length (null: for the photo's)"
    )
    values: Literal["signed", "zero_to_one"] = Field(description="normals: signed (-1..1) | zero_to_one (n = 2 v - 1)")
