"""Depth as networks, files or a depth camera have it, before anything is compared with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from room2dgs.config import PriorConfig
from room2dgs.depth.network.maps import read_models
from room2dgs.depth.simulated import simulated
from room2dgs.depth.sources.source import SourceInput
from room2dgs.depth.state import DepthSettings, DepthState
from room2dgs.logs import Log
from room2dgs.registries.depth_sources import DEPTH_SOURCES


def propose(state: DepthState, settings: DepthSettings) -> DepthState:
    """Ask the depth source once; a second pass has the same proposal.

    Raises:
        InputError: no map for any frame, an unusable one, or a model that cannot be used.
    """
    if state.proposal is not None:
        return state
    with settings.timed("maps"):
        models = read_models(settings.prior)
        given = SourceInput(state.frames, state.sparse, settings.prior, models, settings.log)
        proposal = DEPTH_SOURCES.load(settings.prior.depth.source).depth(given)
        label = _label(proposal.prior, settings.log)
    return replace(state, proposal=replace(proposal, label=label))


def _label(config: PriorConfig, log: Log) -> str:
    parts = [part for part in (config.depth, config.normal) if part.source != "none"]
    if any(part.source == "files" and simulated(Path(part.path or "")) for part in parts):
        log("simulated priors: made from ground truth, for studies only")
        return "simulated"
    return "+".join(sorted({part.source for part in parts})) or "none"
