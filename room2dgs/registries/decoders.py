"""Where surfels have their attributes from: the values of `seeds.decoder`."""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry

DECODERS: Registry[Any] = Registry("decoder")
DECODERS.register("explicit", "room2dgs.seeds.decoders.explicit:ExplicitDecoder", "Every surfel stores its attributes.")
DECODERS.register(
    "shared", "room2dgs.seeds.decoders.shared:SharedDecoder", "A network decodes them from a feature of each seed."
)
