"""What stereo leaves empty, filled: `room2dgs depth fill=true`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.commands.stages import with_map_cache
from room2dgs.commands.units import note_scale
from room2dgs.config import Config
from room2dgs.logs import Log
from room2dgs.runs.metrics import Stages, timed

if TYPE_CHECKING:
    from room2dgs.captures.point_cloud import PointCloud
    from room2dgs.depth import Priors
    from room2dgs.geometry.camera import Camera
    from room2dgs.stereo.dense import DenseView


def with_prior(overrides: Sequence[str]) -> list[str]:
    """The overrides, and the network as prior unless they choose another."""
    chosen = any(text.partition("=")[0] in ("prior", "prior/depth") for text in overrides)
    return [*([] if chosen else ["prior=room_prior"]), *overrides]


def filled(
    scene: Scene,
    points: PointCloud,
    cameras: Sequence[Camera],
    views: Sequence[DenseView],
    config: Config,
    out: Path,
    log: Log,
    seconds: Stages,
) -> Priors:
    """The prior's depth as a run has it, held in place by the stereo that is there already.

    Args:
        points: the scene's sparse ones.
        cameras, views: of stereo, in the order of the training views.

    Raises:
        InputError: as `load_priors`.
    """
    from room2dgs.depth import load_priors
    from room2dgs.stereo.anchors import StereoPoints, stereo_points, with_stereo
    from room2dgs.stereo.passes import Compared, FirstPass, weigh

    def compare(first: FirstPass | None) -> StereoPoints:
        if first:
            passes, device = config.prior.depth.passes, config.render.device
            return stereo_points(
                scene.keyframes, points, config.stereo, log, device, first, passes=passes, beside=scene.beside
            )
        maps = {
            frame.name: (view.depth.copy(), view.agreeing) for frame, view in zip(scene.keyframes, views, strict=True)
        }
        photos = Compared(scene.keyframes, scene.beside, points, config.stereo, log, config.render.device)
        weigh(photos, cameras, maps)
        return StereoPoints(with_stereo(points, scene.keyframes, cameras, maps), maps)

    settings = with_map_cache(config, out).prior
    priors = load_priors(scene.keyframes, points, settings, log, compare, partial(timed, seconds))
    note_scale(priors, points, scene, config, out, log)
    return priors
