"""No source: no depth, no normals."""

from __future__ import annotations

from room2dgs.depth.sources.source import DepthSource, Proposal, SourceInput


def _depth(given: SourceInput) -> Proposal:
    return Proposal(given.prior, models=given.models)


NOTHING = DepthSource(_depth)
