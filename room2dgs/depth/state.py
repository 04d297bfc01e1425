"""What the stages of depth estimation work on: `DepthState`, changed from stage to stage, and `DepthSettings`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.captures.uncertainty import measured_weight
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import DepthPriorConfig, PriorConfig
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.completion.correction import Correct
from room2dgs.depth.completion.free_space import FreeSpace
from room2dgs.depth.completion.planes import Plane
from room2dgs.logs import Log
from room2dgs.stereo.depth_samples import DepthSamples
from room2dgs.stereo.passes import FirstPass, StereoMaps

if TYPE_CHECKING:
    from room2dgs.depth.completion.views import LowResViews
    from room2dgs.depth.sources.source import Proposal

Timed = Callable[[str], AbstractContextManager[None]]
CompareViews = Callable[[FirstPass | None], DepthSamples]


def untimed(_stage: str) -> AbstractContextManager[None]:
    """Does nothing."""
    return nullcontext()


@dataclass(frozen=True)
class DepthSettings:
    """What the stages need beside the state; no stage changes it.

    Attributes:
        prior: sources and conventions; `depth.source` may still be "auto", see `Proposal.prior`.
        compare: finds stereo's depth samples: in the first pass, and, begun with what it led to, in the second; None:
            photos are not compared.
        correct: corrects completed depth; None: as the settings say.
        log: takes one line at a time.
        timed: gives, for a stage's name, what to do that stage in: "stereo", "maps" (proposed and aligned), "joint" and
            "completion".
    """

    prior: PriorConfig
    compare: CompareViews | None = None
    correct: Correct | None = None
    log: Log = print
    timed: Timed = untimed


@dataclass(frozen=True)
class DepthState:
    """What is known of the depth and the normals of some views.

    Maps are read or made when they are asked for: all of them at full size would be most of a run's memory. Trust in
    a depth is its relative standard deviation, sigma (`captures.uncertainty`); `maps` alone hold weights made of it,
    since they are what losses take.

    Attributes:
        frames: the views.
        sparse: the scene's sparse points, metres.
        maps: frame name -> depth, normals and their weights, as far as they are found; in the frames' cache.
        proposal: what the sources say; None before `propose`.
        samples: sparse points and stereo's depth samples; those that other views look through weigh less.
        stereo: stereo's maps of this pass.
        free_space: what the views look through; None: not wanted.
        depths: frame name -> (H, W) float32 metres, 0 = invalid: aligned, then jointly optimised; none once completed.
        sigmas: frame name -> (H, W) relative standard deviation of the depth, of the views whose source gives it.
        fits: frame name -> its depth's alignment, left out or not.
        normals: frame name -> (H, W, 3) float32 unit normals, world frame, facing the camera; 0 = invalid.
        normal_weights: frame name -> (H, W) weights of the normals, of the views that have them.
        low_res: the views at the resolution at which depth is completed; None outside completion.
        planes: the room's planes that depth is drawn to.
        completed: whether this pass has completed the depth.
        pass_number: 0, or 1 in the second pass.
    """

    frames: Sequence[Frame]
    sparse: PointCloud
    maps: StoredMaps
    samples: PointCloud
    proposal: Proposal | None = None
    stereo: StereoMaps = field(default_factory=dict)
    free_space: FreeSpace | None = None
    depths: Mapping[str, np.ndarray] = field(default_factory=dict)
    sigmas: Mapping[str, np.ndarray] = field(default_factory=dict)
    fits: Mapping[str, Fit] = field(default_factory=dict)
    normals: Mapping[str, np.ndarray] = field(default_factory=dict)
    normal_weights: Mapping[str, np.ndarray] = field(default_factory=dict)
    low_res: LowResViews | None = None
    planes: tuple[Plane, ...] = ()
    completed: bool = False
    pass_number: int = 0

    @property
    def proposed(self) -> Proposal:
        """`proposal`, of which there is one after the first stage."""
        assert self.proposal is not None
        return self.proposal

    @property
    def depth_settings(self) -> DepthPriorConfig:
        """Settings of the depth prior, its source decided."""
        return self.proposed.prior.depth

    def completed_depths(self) -> Mapping[str, np.ndarray]:
        """Frame name -> (H, W) depth as the pass before has left it."""
        return stored(self.maps, "depth")

    def depth_weights(self) -> Mapping[str, np.ndarray]:
        """Frame name -> (H, W) float32 weights of the source's depth, of the views that have a sigma."""
        return weights_of(self.sigmas, self.depth_settings)

    def put_depth(self, name: str, depth: np.ndarray, weight: np.ndarray | None) -> None:
        """Store a view's depth, and its weights where it is valid, beside its normals."""
        weight = None if weight is None else np.where(depth > 0, weight, np.float32(0))
        maps = self.maps.get(name, ViewMaps(source=self.proposed.label))
        self.maps.put(name, maps._replace(depth=depth, depth_confidence=weight))


def first_state(frames: Sequence[Frame], points: PointCloud) -> DepthState:
    """Before any stage.

    Args:
        points: sparse points, metres.
    """
    maps = StoredMaps(next((frame.cache for frame in frames if frame.cache), None))
    return DepthState(frames, points, maps, samples=points)


def next_pass(state: DepthState) -> DepthState:
    """Before the second pass, which begins with the completed depth and the first pass's stereo.

    The first pass's samples need not be in memory during the second.
    """
    return replace(
        state, samples=state.sparse, free_space=None, depths={}, completed=False, pass_number=state.pass_number + 1
    )


def weights_of(sigmas: Mapping[str, np.ndarray], settings: DepthPriorConfig) -> Mapping[str, np.ndarray]:
    """Frame name -> (H, W) float32 weights, made when they are asked for."""
    weights: LazyMaps[np.ndarray] = LazyMaps()
    for name in sigmas:
        weights.add(name, partial(_weight, sigmas, name, settings))
    return weights


def _weight(sigmas: Mapping[str, np.ndarray], name: str, settings: DepthPriorConfig) -> np.ndarray:
    return measured_weight(sigmas[name], settings.error_scale, settings.max_error)


def stored(maps: StoredMaps, kind: str) -> Mapping[str, np.ndarray]:
    """Frame name -> one of the `ViewMaps`, of the views that have it; read when it is asked for."""
    found: LazyMaps[np.ndarray] = LazyMaps()
    for name, view in maps.items():
        if getattr(view, kind) is not None:
            found.add(name, partial(_stored_map, maps, name, kind))
    return found


def _stored_map(maps: StoredMaps, name: str, kind: str) -> np.ndarray:
    return getattr(maps[name], kind)
