"""A network as a source: the one that comes with the package, or any .onnx file. Its maps are cached on disk."""

from __future__ import annotations

from room2dgs.depth.network.maps import predicted_maps
from room2dgs.depth.sources.map_files import normals_of_files, proposal_of_files
from room2dgs.depth.sources.source import DepthSource, NormalMaps, Proposal, SourceInput


def _depth(given: SourceInput) -> Proposal:
    return proposal_of_files(given, predicted_maps(given.frames, "depth", given.prior, given.models, given.log))


def _normals(given: SourceInput) -> NormalMaps:
    return normals_of_files(given, predicted_maps(given.frames, "normal", given.prior, given.models, given.log))


NETWORK = DepthSource(_depth, _normals)
