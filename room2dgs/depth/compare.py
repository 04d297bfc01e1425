"""Stereo as a stage: depth samples from the photos, and the free space that their rays pass through."""

from __future__ import annotations

from dataclasses import replace

from room2dgs.depth.completion.free_space import free_space, less_where_seen_through, rays_to
from room2dgs.depth.state import DepthSettings, DepthState
from room2dgs.stereo.passes import FirstPass


def compares_photos(state: DepthState, settings: DepthSettings) -> bool:
    """Whether there are depth maps that stereo could correct; a depth camera's stay as they are."""
    return settings.compare is not None and state.depth_settings.joint and state.depth_settings.source != "none"


def compare(state: DepthState, settings: DepthSettings) -> DepthState:
    """Compare the photos; in the second pass from the completed depth on.

    Raises:
        InputError: as `scene_stereo`.
    """
    if settings.compare is None or not compares_photos(state, settings):
        return state
    with settings.timed("stereo"):
        first = FirstPass(state.completed_depths(), state.stereo) if state.pass_number else None
        found = settings.compare(first)
        if not state.depth_settings.free_space:
            return replace(state, samples=found.points, stereo=found.maps)
        space = free_space([rays_to(found.points, frame) for frame in state.frames])
        samples = less_where_seen_through(found.points, space)
        return replace(state, samples=samples, stereo=found.maps, free_space=space)
