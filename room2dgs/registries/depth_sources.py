"""Where prior depth and normals come from: the values of `prior.depth.source` and `prior.normal.source`.

Each entry is a `DepthSource` (room2dgs.depth.sources.source). A new one is a module with a `DepthSource` and one entry
here. Its facts:

    normals: it gives normals, too.
    network: a network makes its maps, which its card describes.
    several: that network sees several photos at a time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from room2dgs.registry import Registry

if TYPE_CHECKING:
    from room2dgs.depth.sources.source import DepthSource

DEPTH_SOURCES: Registry[DepthSource] = Registry("depth source")

_AT = "room2dgs.depth.sources"
_FACTS = {"normals": False, "network": False, "several": False}
_NETWORK = _FACTS | {"normals": True, "network": True}
DEPTH_SOURCES.register("none", f"{_AT}.nothing:NOTHING", "No maps.", **_FACTS | {"normals": True})
DEPTH_SOURCES.register("files", f"{_AT}.files:FILES", "Maps of your own, in a folder.", **_FACTS | {"normals": True})
DEPTH_SOURCES.register("onnx", f"{_AT}.networks:NETWORK", "A network of your own, in ONNX.", **_NETWORK)
DEPTH_SOURCES.register(
    "onnx_multiview",
    f"{_AT}.multiview:MULTIVIEW",
    "A network of your own that sees several photos at a time and their poses, in ONNX.",
    **_FACTS | {"network": True, "several": True},
)
DEPTH_SOURCES.register("room_prior", f"{_AT}.networks:NETWORK", "The network that comes with room2dgs.", **_NETWORK)
DEPTH_SOURCES.register("sensor", f"{_AT}.sensor:SENSOR", "The depth files of the capture's own camera.", **_FACTS)
DEPTH_SOURCES.register("auto", f"{_AT}.sensor:AUTO", "The depth camera where there is one, else room_prior.", **_FACTS)
