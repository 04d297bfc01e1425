"""A network that sees several photos at a time as a source of depth. Its maps are cached on disk."""

from __future__ import annotations

from room2dgs.config.card import card_of
from room2dgs.depth.network.multiview_maps import multiview_maps
from room2dgs.depth.sources.map_files import proposal_of_files
from room2dgs.depth.sources.source import DepthSource, Proposal, SourceInput


def _depth(given: SourceInput) -> Proposal:
    files = multiview_maps(given.frames, given.prior, given.models["depth"], given.log)
    depth = card_of(given.prior.depth, "depth").depth
    return proposal_of_files(given, files, doubts=depth is not None and depth.confidence is not None)


MULTIVIEW = DepthSource(_depth)
