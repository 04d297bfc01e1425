"""How seeds become primitives: the values of `seeds.decoder`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.seeds.decoders.decoder import DecoderKind

# fact max_sh_degree: of the colours that it decodes; without it any
DECODERS: Registry[DecoderKind] = Registry("decoder")
_AT = "room2dgs.seeds.decoders"
DECODERS.register("explicit", f"{_AT}.explicit:EXPLICIT", "Each primitive stores its own attributes.")
DECODERS.register(
    "shared", f"{_AT}.shared:SHARED", "A network decodes the attributes from a feature of each seed.", max_sh_degree=0
)
