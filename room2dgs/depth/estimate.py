"""Depth and normals of a scene's training views before anything is trained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.config import Config, PriorConfig
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.depth.completion.correction import Correct
from room2dgs.depth.completion.planes import Plane
from room2dgs.depth.stages import run_stages
from room2dgs.depth.state import CompareViews, DepthSettings, Timed, first_state, untimed
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.depth_samples import DepthSamples, stereo_samples, with_depth_samples
from room2dgs.stereo.passes import FirstPass, StereoInput, StereoMaps, calibrated_maps


@dataclass(frozen=True)
class Priors:
    """Depth and normals of some views, as training takes them.

    Attributes:
        by_frame: frame name -> maps, for the frames that have one; in the frames' cache.
        fits: frame name -> its depth's alignment, for every frame with a depth map, left out or not.
        label: "simulated" if any map says so, else the sources: "room_prior", "room_prior+sensor", "files", or "none".
        networks: "depth" and "normal" -> digest of the model that made the maps (`ModelFile.digest`).
        depth_source: where depth comes from, "auto" decided: "sensor", "room_prior", "files", "onnx" or "none".
        planes: the room's planes that completion drew depth to.
        stereo: frame name -> stereo's depth of the last pass.
    """

    by_frame: StoredMaps
    fits: Mapping[str, Fit]
    label: str
    networks: Mapping[str, str]
    depth_source: str
    planes: tuple[Plane, ...] = ()
    stereo: StereoMaps = field(default_factory=dict)


class StereoViews(NamedTuple):
    """Stereo of all keyframes that is there already, in their order.

    Attributes:
        cameras: at stereo's image size.
        views: what was found in each.
    """

    cameras: Sequence[Camera]
    views: Sequence[DenseView]


def estimate_depth(
    scene: Scene,
    points: PointCloud,
    config: Config,
    cache: Path,
    log: Log = print,
    timed: Timed = untimed,
    stereo: StereoViews | None = None,
    correct: Correct | None = None,
) -> Priors:
    """Depth and normals of the keyframes, from all sources that the settings name (`stages.STAGES`).

    Args:
        points: sparse points, metres.
        cache: folder for the networks' maps, unless `prior.cache` names one.
        log: takes one line at a time.
        timed: as `DepthSettings`.
        stereo: of the first pass, if it is there already; then photos are compared whatever `stereo.enabled` says.
        correct: corrects completed depth; None: what the settings say.

    Raises:
        InputError: no map for any frame, an unusable map, or normals in another convention than configured; a photo
            cannot be decoded or is too large for stereo.
    """
    photos = StereoInput(scene.keyframes, scene.beside, points, config.stereo, log, config.render.device)
    prior = replace(config.prior, cache=config.prior.cache or str(cache))
    compare = comparing(photos, prior.depth.passes, stereo) if config.stereo.enabled or stereo else None
    return depth_of_frames(scene.keyframes, points, prior, log, compare, timed, correct)


def depth_of_frames(
    frames: Sequence[Frame],
    points: PointCloud,
    prior: PriorConfig,
    log: Log = print,
    compare: CompareViews | None = None,
    timed: Timed = untimed,
    correct: Correct | None = None,
) -> Priors:
    """As `estimate_depth`, of any frames.

    Args:
        compare: as `DepthSettings`; None: photos are not compared.
    """
    state = run_stages(first_state(frames, points), DepthSettings(prior, compare, correct, log, timed))
    proposal = state.proposed
    networks = {kind: model.digest for kind, model in proposal.models.items()}
    source = proposal.prior.depth.source
    return Priors(state.maps, state.fits, proposal.label, networks, source, state.planes, state.stereo)


def comparing(photos: StereoInput, passes: int, given: StereoViews | None = None) -> CompareViews:
    """A function that compares the photos: in the first of so many passes, and from what it led to in the second.

    Args:
        given: of the first pass, if it is there already.
    """

    def compare(first: FirstPass | None) -> DepthSamples:
        if first is not None or given is None:
            return stereo_samples(photos, first, passes=passes)
        maps = calibrated_maps(photos, given.cameras, given.views)
        return DepthSamples(with_depth_samples(photos.points, photos.frames, given.cameras, maps), maps)

    return compare
