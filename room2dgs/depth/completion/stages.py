"""Completion as stages: depth between the samples, at low resolution, drawn to planes and to other views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from room2dgs import _C
from room2dgs.captures.scene import Frame
from room2dgs.depth.compare import compares_photos
from room2dgs.depth.completion.corrected import corrected
from room2dgs.depth.completion.correction import Correct, correction_by_network
from room2dgs.depth.completion.expected_sigma import expecting
from room2dgs.depth.completion.interpolate import interpolated
from room2dgs.depth.completion.low_res import LowResInput, low_res_input
from room2dgs.depth.completion.on_planes import flattened_view
from room2dgs.depth.completion.reconciled import on_their_planes, with_neighbours
from room2dgs.depth.completion.restore import Restored, restored
from room2dgs.depth.completion.room_planes import CORRECTED, planes_in
from room2dgs.depth.completion.targets import drawn_to_other_views, drawn_to_planes
from room2dgs.depth.completion.views import LowResViews, near_views
from room2dgs.depth.state import DepthSettings, DepthState
from room2dgs.parallel_map import parallel_map
from room2dgs.torch_threads import one_torch_thread


@one_torch_thread()  # here and not in each of the threads below, which would put back what others have set
def reduce_resolution(state: DepthState, settings: DepthSettings) -> DepthState:
    """The views at the low resolution at which depth is completed, if it is to be completed."""
    wanted = state.depth_settings.joint and state.depth_settings.completion
    if not (wanted and state.depths and len(state.samples)):
        return state
    frames = [frame for frame in state.frames if frame.name in state.depths]
    weights, normals, normal_weights = state.depth_weights(), state.normals, state.normal_weights
    misfit = _misfit(state, frames)

    def reduced(frame: Frame) -> LowResInput:
        name = frame.name
        maps = (state.depths[name], weights.get(name), normals.get(name), normal_weights.get(name))
        return low_res_input(frame, *maps, state.samples, misfit)

    with settings.timed("completion"):
        with ThreadPoolExecutor(_C.threads()) as pool:
            inputs = list(pool.map(reduced, frames))
        return replace(state, low_res=LowResViews(frames, inputs, near_views(frames, state.samples)), planes=())


@one_torch_thread()
def complete(state: DepthState, settings: DepthSettings) -> DepthState:
    """Depth between the samples: at first each view by itself, then drawn to planes and to what other views have."""
    views = state.low_res
    if views is None or (views.together and not _alternates(state)):
        return state
    with settings.timed("completion"), ThreadPoolExecutor(_C.threads()) as pool:
        if not views.together:
            first = interpolated(views.inputs, pool)
            return replace(state, low_res=replace(views, alone=first, together=first))
        draw = partial(drawn_to_planes, planes=state.planes, space=state.free_space)
        inputs = list(pool.map(draw, views.inputs, views.together))
        drawn = None
        if state.depth_settings.other_views:
            assert views.sigmas is not None
            drawn = drawn_to_other_views(inputs, views.together, views.sigmas, views.near)
        alone = interpolated(inputs, pool)  # depth from other views is no evidence
        together = interpolated(drawn, pool) if drawn else alone
        return replace(state, low_res=replace(views, alone=alone, together=together, sigmas=None))


@one_torch_thread()
def fit_planes(state: DepthState, settings: DepthSettings) -> DepthState:
    """What is to be expected of each view's depth, and the room's planes in the depth of all."""
    views = state.low_res
    if views is None or not _alternates(state):
        return state
    with settings.timed("completion"), ThreadPoolExecutor(_C.threads()) as pool:
        sigmas = list(pool.map(_expecting(state, views), range(len(views.frames))))
        planes = planes_in(views, sigmas, state.free_space, state.depth_settings, pool) if _wants_planes(state) else []
        return replace(state, planes=tuple(planes), low_res=replace(views, sigmas=sigmas))


@one_torch_thread()
def flatten(state: DepthState, settings: DepthSettings) -> DepthState:
    """What almost lies on a plane lies on it: between samples and slopes depth follows the samples' noise."""
    views = state.low_res
    if views is None:
        return state
    flat = partial(flattened_view, planes=state.planes)
    with settings.timed("completion"), ThreadPoolExecutor(_C.threads()) as pool:
        together = list(pool.map(flat, views.inputs, views.together))
        alone = list(pool.map(flat, views.inputs, views.alone))
    return replace(state, low_res=replace(views, alone=alone, together=together, sigmas=None))


@one_torch_thread()
def correct(state: DepthState, settings: DepthSettings) -> DepthState:
    """Each view by the network, then all of them made one: by their neighbours, and by planes found anew.

    Raises:
        InputError: the network is missing or damaged.
    """
    views, by = state.low_res, _correction(state, settings)
    if views is None or by is None:
        return state
    with settings.timed("completion"):
        together, sigmas = corrected(views, state.free_space, state.planes, by)
        if state.depth_settings.other_views:
            together, sigmas = with_neighbours(together, sigmas, views.near)
        views, planes = replace(views, together=together), []
        if _wants_planes(state):
            with ThreadPoolExecutor(_C.threads()) as pool:
                planes = planes_in(views, sigmas, state.free_space, state.depth_settings, pool, CORRECTED)
        together = on_their_planes(views.inputs, together, sigmas, planes)
        return replace(state, planes=tuple(planes), low_res=replace(views, together=together, sigmas=sigmas))


@one_torch_thread()
def restore_resolution(state: DepthState, settings: DepthSettings) -> DepthState:
    """The completed depth at the photos' size, with stereo's own detail; it is stored with its weights."""
    views = state.low_res
    if views is None:
        return state
    expected = _expecting(state, views) if views.sigmas is None else views.sigmas.__getitem__

    def whole(index: int) -> Restored:
        frame = views.frames[index]
        depth, stereo = state.depths[frame.name], state.stereo.get(frame.name)
        return restored(depth, views.together[index], expected(index), stereo, frame.camera)

    medians = []
    with settings.timed("completion"):
        for frame, one in zip(views.frames, parallel_map(whole, range(len(views.frames)), _C.threads()), strict=True):
            medians.append(one.median_sigma)
            state.put_depth(frame.name, one.depth, one.weight)
    if views.frames:
        surface = sum(plane.share for plane in state.planes)
        on = f"; planes: {len(state.planes)}, with {surface:.0%} of the surface" if state.planes else ""
        expects = f"expected error {np.nanmedian(medians):.1%} (median)"
        settings.log(f"completion: depth of {len(views.frames)} views, {expects}{on}")
    return replace(state, low_res=None, depths={}, completed=True)


def _misfit(state: DepthState, frames: Sequence[Frame]) -> float:
    """Median over the views of how far the prior is off the points before any optimisation: where the network does
    badly its maps bend to the points. Of a single view it says little where the view has few points."""
    fits = [state.fits[frame.name].residual for frame in frames if frame.name in state.fits]
    known = [residual for residual in fits if np.isfinite(residual)]
    return float(np.median(known)) if known else 0.0


def _wants_planes(state: DepthState) -> bool:
    return state.depth_settings.planes and len(state.normals) > 0


def _alternates(state: DepthState) -> bool:
    """Whether planes and completion alternate; a depth that nothing is drawn to is completed once."""
    return _wants_planes(state) or state.depth_settings.other_views


def _expecting(state: DepthState, views: LowResViews) -> Callable[[int], np.ndarray]:
    return expecting(views.together, views.alone, views.near, state.free_space)


def _correction(state: DepthState, settings: DepthSettings) -> Correct | None:
    """What corrects; the network has learnt from depth that stereo has seen."""
    if settings.correct is not None:
        return settings.correct
    wanted = compares_photos(state, settings) and state.depth_settings.completion and state.depth_settings.correction
    return correction_by_network() if wanted else None
