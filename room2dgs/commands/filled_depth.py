"""What stereo leaves empty, filled: `room2dgs depth fill=true`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.commands.units import note_scale
from room2dgs.config import Config
from room2dgs.logs import Log
from room2dgs.runs.folder import PRIOR_MAPS
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
        InputError: as `estimate_depth`.
    """
    from room2dgs.depth import StereoViews, estimate_depth

    stereo = StereoViews(cameras, views)
    priors = estimate_depth(scene, points, config, out / PRIOR_MAPS, log, partial(timed, seconds), stereo)
    note_scale(priors, points, scene, config, out, log)
    return priors
