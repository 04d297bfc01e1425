"""The method: how the depth of a room's photos is estimated, stage by stage.

Networks, files or a depth camera propose depth; stereo compares the photos and gives depth samples; proposals are
aligned to the samples and optimised jointly; then the depth between the samples is completed, drawn to the room's
planes and to what other views know, and corrected by a network. A second pass is the same list again: stereo then
begins with the completed depth.

Every stage takes the state and the settings and returns the next state. A stage that the settings leave out, or that
has nothing to work on, returns the state as it is.
"""

from __future__ import annotations

from collections.abc import Callable

from room2dgs.depth.align.stage import align
from room2dgs.depth.compare import compare, compares_photos
from room2dgs.depth.completion.stages import (
    complete,
    correct,
    fit_planes,
    flatten,
    reduce_resolution,
    restore_resolution,
)
from room2dgs.depth.joint.stage import optimise_jointly
from room2dgs.depth.normals.stage import read_normals
from room2dgs.depth.propose import propose
from room2dgs.depth.state import DepthSettings, DepthState, next_pass
from room2dgs.depth.store import store_aligned

Stage = Callable[[DepthState, DepthSettings], DepthState]
STAGES: tuple[Stage, ...] = (
    propose,  # what networks, files or a depth camera say of each photo
    compare,  # stereo: depth samples where several photos show the same
    align,  # each proposal to the samples that its photo sees: scale and shift
    read_normals,  # and their convention checked
    optimise_jointly,  # smooth log-scales of all views, until views, samples and normals agree
    reduce_resolution,
    complete,  # between the samples, each view by itself
    fit_planes,  # in the completed depth of all views
    complete,  # drawn to the planes and to what other views are sure of
    fit_planes,
    complete,
    flatten,  # what almost lies on a plane lies on it
    correct,  # by a network that has learnt where all of this goes wrong
    restore_resolution,
    store_aligned,  # where depth is not completed
)


def run_stages(state: DepthState, settings: DepthSettings) -> DepthState:
    """All stages, once or twice.

    Raises:
        InputError: as the stages.
    """
    while True:
        for stage in STAGES:
            state = stage(state, settings)
        passes = state.depth_settings.passes if compares_photos(state, settings) else 1
        if not state.completed or state.pass_number + 1 == passes:
            return state
        state = next_pass(state)
