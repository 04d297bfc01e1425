"""A network's card as one map's network reads it: its input, and where the map comes out."""

from __future__ import annotations

from dataclasses import dataclass

from room2dgs.config import DepthPriorConfig, NormalPriorConfig
from room2dgs.config.card import Card, CardDepth, CardNormal, card_of


@dataclass(frozen=True)
class NetworkFormat:
    """What goes into a network and how one map comes out; `config.card` says what each means.

    A map's key in the map cache is made of these names and values.
    """

    input: str | None
    intrinsics: str | None
    tokens: str | None
    height: int | None
    width: int | None
    multiple: int
    fit: str
    layout: str
    channels: str
    white: float
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    flip: bool
    output: str | None
    mask: str | None
    error_output: str | None
    output_channel: int | None = None
    canonical_focal_px: float | None = None
    values: str = "signed"


# Where a card says what a field of `NetworkFormat` says, for messages; {} is depth or normal.
IN_CARD = {
    **{name: f"input.{name}" for name in ("intrinsics", "tokens", "height", "width", "layout")},
    "input": "input.name",
    "output": "{}.output",
    "mask": "{}.mask",
    "error_output": "{}.error",
    "output_channel": "depth.channel",
    "values": "normal.values",
}


def format_of(part: DepthPriorConfig | NormalPriorConfig, kind: str) -> NetworkFormat:
    """What the network of a prior reads and gives.

    Args:
        kind: "depth" or "normal".

    Raises:
        InputError: as `card_of`.
    """
    return card_format(card_of(part, kind), kind)


def card_format(card: Card, kind: str) -> NetworkFormat:
    """What a card says of the input and of one map, which it has."""
    given, made = card.input, card.depth if kind == "depth" else card.normal
    assert made is not None
    depth = made if isinstance(made, CardDepth) else None
    normal = made if isinstance(made, CardNormal) else None
    return NetworkFormat(
        input=given.name,
        intrinsics=given.intrinsics,
        tokens=given.tokens,
        height=given.height,
        width=given.width,
        multiple=given.multiple,
        fit=given.fit,
        layout=given.layout,
        channels=given.channels,
        white=given.white,
        mean=given.mean,
        std=given.std,
        flip=given.flip,
        output=made.output,
        mask=made.mask,
        error_output=made.error,
        output_channel=depth.channel if depth else None,
        canonical_focal_px=depth.canonical_focal_px if depth else None,
        values=normal.values if normal else "signed",
    )
