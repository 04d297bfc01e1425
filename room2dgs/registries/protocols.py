"""The protocols that score a mesh.

Facts of each entry:
    truth: what it compares with: `MESH`, a ground truth, or `DEPTH`, the depth that a sensor measured in each photo.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.eval.protocol import Protocol

MESH, DEPTH = "mesh", "depth"

PROTOCOLS: Registry[Protocol] = Registry("protocol")
PROTOCOLS.register(
    "area",
    "room2dgs.eval.protocol_area:area",
    "Samples both surfaces by area where cameras see them; it depends on neither mesh's vertices.",
    truth=MESH,
)
PROTOCOLS.register(
    "neuris",
    "room2dgs.eval.protocol_neuris:neuris",
    "Compares vertices as NeuRIS does, after culling what no camera sees.",
    truth=MESH,
)
PROTOCOLS.register(
    "manhattan",
    "room2dgs.eval.protocol_manhattan:manhattan",
    "Compares vertices as ManhattanSDF does, after rendering and fusing the prediction again.",
    truth=MESH,
)
PROTOCOLS.register(
    "depth",
    "room2dgs.eval.protocol_depth:depth",
    "Compares depth with the capture's depth maps in each photo's own frame; it needs no ground-truth mesh.",
    truth=DEPTH,
)


def against(truth: str, names: Iterable[str]) -> list[str]:
    """Those of the named protocols that compare with `MESH` or with `DEPTH`, in their order.

    Raises:
        InputError: there is no protocol of a name.
    """
    return [name for name in names if PROTOCOLS.get(name).facts["truth"] == truth]
