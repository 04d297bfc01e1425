"""What a source of depth and normals is given, and what it says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.config import DepthPriorConfig, PriorConfig
from room2dgs.depth.align.one_view import RawMap
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.network.maps import read_models
from room2dgs.depth.network.model_file import ModelFile
from room2dgs.logs import Log


@dataclass(frozen=True)
class SourceInput:
    """What a source is given.

    Attributes:
        frames: views whose maps are wanted.
        points: the scene's sparse points, metres.
        prior: sources and conventions.
        models: kind ("depth", "normal") -> model, for the kinds that a network makes.
        log: takes one line at a time.
    """

    frames: Sequence[Frame]
    points: PointCloud
    prior: PriorConfig
    models: Mapping[str, ModelFile]
    log: Log

    def with_depth(self, depth: DepthPriorConfig) -> SourceInput:
        """With other settings of the depth, "auto" decided, and the models that these need.

        Raises:
            InputError: as `read_models`.
        """
        prior = replace(self.prior, depth=depth)
        return replace(self, prior=prior, models=read_models(prior))


@dataclass(frozen=True)
class Proposal:
    """What a source says of some photos' depth; maps are read when asked for.

    Attributes:
        prior: the settings, with "auto" decided.
        raw: frame name -> values as the source has them, and where they are valid; to be aligned.
        measured: frame name -> (H, W) float32 metres, 0 = invalid: of a depth camera, which nothing aligns or bends.
        sigmas: frame name -> (H, W) relative standard deviation, for the maps that come with one.
        doubts: frame name -> (H, W) what is the larger, the larger the error of the aligned map is, in no unit: by how
            much, the samples tell (`align.calibrated`).
        fits: frame name -> how far a measured map is off the points that its photo sees.
        models: kind -> the model that makes these maps.
        label: "simulated" if any map says so, else the sources: "room_prior", "files+onnx", or "none".
    """

    prior: PriorConfig
    raw: Mapping[str, RawMap] = field(default_factory=dict)
    measured: Mapping[str, np.ndarray] = field(default_factory=dict)
    sigmas: Mapping[str, np.ndarray] = field(default_factory=dict)
    doubts: Mapping[str, np.ndarray] = field(default_factory=dict)
    fits: Mapping[str, Fit] = field(default_factory=dict)
    models: Mapping[str, ModelFile] = field(default_factory=dict)
    label: str = ""


class NormalMap(NamedTuple):
    """One photo's normals as its source has them.

    Attributes:
        normal: (H, W, 3) float32 unit, in the source's axes; invalid ones are 0.
        valid: (H, W) bool.
        sigma: (H, W) standard deviation in radians; None: the source gives none.
    """

    normal: np.ndarray
    valid: np.ndarray
    sigma: np.ndarray | None


NormalMaps = Mapping[str, NormalMap]


def _no_normals(_given: SourceInput) -> NormalMaps:
    return {}


class DepthSource(NamedTuple):
    """One entry of `room2dgs.registries.depth_sources`.

    Attributes:
        depth: what it says of all photos' depth.
        normals: frame name -> normals of the photos that have them, read when asked for. It is asked about a few
            photos first, and about all once their convention is found to be right.
    """

    depth: Callable[[SourceInput], Proposal]
    normals: Callable[[SourceInput], NormalMaps] = _no_normals
