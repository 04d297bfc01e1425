"""Alignment as a stage: each proposed depth map to the samples that its photo sees."""

from __future__ import annotations

from dataclasses import replace

from room2dgs.depth.align.calibrated import calibrated_sigmas
from room2dgs.depth.align.depths import aligned_depths
from room2dgs.depth.state import DepthSettings, DepthState


def align(state: DepthState, settings: DepthSettings) -> DepthState:
    """Scale and shift of each map; those of a depth camera stay as measured.

    Raises:
        InputError: an unusable map.
    """
    proposal = state.proposed
    if proposal.measured:
        return replace(state, depths=proposal.measured, sigmas=proposal.sigmas, fits=proposal.fits)
    if state.depth_settings.source == "none":
        return state
    with settings.timed("maps"):
        depths, fits = aligned_depths(state.frames, proposal.raw, state.samples, state.depth_settings, settings.log)
        sigmas = proposal.sigmas
        if proposal.doubts:
            sigmas = calibrated_sigmas(state.frames, depths, proposal.doubts, state.samples, settings.log)
    return replace(state, depths=depths, sigmas=sigmas, fits=fits)
