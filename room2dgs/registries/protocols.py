"""The protocols that score a mesh against a ground truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.eval.protocol import Protocol

PROTOCOLS: Registry[Protocol] = Registry("protocol")
PROTOCOLS.register(
    "area",
    "room2dgs.eval.protocol_area:area",
    "Samples both surfaces by area where cameras see them; it depends on neither mesh's vertices.",
)
PROTOCOLS.register(
    "neuris",
    "room2dgs.eval.protocol_neuris:neuris",
    "Compares vertices as NeuRIS does, after culling what no camera sees.",
)
PROTOCOLS.register(
    "manhattan",
    "room2dgs.eval.protocol_manhattan:manhattan",
    "Compares vertices as ManhattanSDF does, after rendering and fusing the prediction again.",
)
