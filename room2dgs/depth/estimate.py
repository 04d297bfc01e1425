"""Depth and normals of a scene's training views before anything is trained."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.depth.completion.correction import Correct
from room2dgs.depth.load import Priors, load_priors
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log
from room2dgs.stereo.dense import DenseView
from room2dgs.stereo.depth_samples import DepthSamples, stereo_samples, with_depth_samples
from room2dgs.stereo.passes import FirstPass, StereoInput, StereoMap, calibrated_maps

Timed = Callable[[str], AbstractContextManager[None]]


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
    timed: Timed = nullcontext,
    stereo: StereoViews | None = None,
    correct: Correct | None = None,
) -> Priors:
    """Depth and normals of the keyframes, from all sources that the settings name.

    Args:
        points: sparse points, metres.
        cache: folder for the networks' maps, unless `prior.cache` names one.
        log: takes one line at a time.
        timed: gives, for a stage's name, what to do that stage in: "stereo", "maps" (read or predicted, and aligned),
            "joint" and "completion".
        stereo: of the first pass, if it is there already; then photos are compared whatever `stereo.enabled` says.
        correct: corrects what completion has made of the views that stereo has seen; None: what the settings say.

    Raises:
        InputError: no map for any frame, an unusable map, or normals in another convention than configured; a photo
            cannot be decoded or is too large for stereo.
    """
    found: dict[str, StereoMap] = {}
    photos = StereoInput(scene.keyframes, scene.beside, points, config.stereo, log, config.render.device)

    def compare(first: FirstPass | None) -> DepthSamples:
        if stereo and not first:
            maps = calibrated_maps(photos, stereo.cameras, stereo.views)
            samples = DepthSamples(with_depth_samples(points, scene.keyframes, stereo.cameras, maps), maps)
        else:
            samples = stereo_samples(photos, first, passes=config.prior.depth.passes)
        found.update(samples.maps)
        return samples

    prior = replace(config.prior, cache=config.prior.cache or str(cache))
    compared = compare if config.stereo.enabled or stereo else None
    priors = load_priors(scene.keyframes, points, prior, log, compared, timed, correct)
    return priors._replace(stereo=found)
