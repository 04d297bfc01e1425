"""Settings whose values are the names of a registry: their types, and what help says of each name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from room2dgs.registries.decoders import DECODERS
from room2dgs.registries.exporters import EXPORTERS
from room2dgs.registries.meshers import MESHERS
from room2dgs.registries.primitives import PRIMITIVES
from room2dgs.registries.protocols import PROTOCOLS
from room2dgs.registries.readers import READERS
from room2dgs.registries.strategies import STRATEGIES
from room2dgs.registry import Registry

if TYPE_CHECKING:
    DecoderName = LayoutName = MesherName = PrimitiveName = ProtocolName = QuickFormatName = StrategyName = str
else:
    DecoderName = Literal[DECODERS.names()]
    LayoutName = Literal[("auto", *READERS.names())]
    MesherName = Literal[MESHERS.names()]
    PrimitiveName = Literal[PRIMITIVES.names()]
    ProtocolName = Literal[PROTOCOLS.names()]
    QuickFormatName = Literal[tuple(one.name for one in EXPORTERS.entries() if one.facts.get("after_run"))]
    StrategyName = Literal[STRATEGIES.names()]


def described(question: str, registry: Registry[Any]) -> str:
    """The description of a setting: what it decides, then each name with its sentence."""
    return " ".join([question, *(f"{entry.name}: {entry.description}" for entry in registry.entries())])
