"""Exposure and white balance of a run's photos."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.metrics import read_metrics

GAINS = "gains"
LEAST = 0.03  # variation from which on photos are evened out: less is what surfaces' gloss and lenses make of any


def with_even_exposure(
    scene: Scene, points: PointCloud, maps: Mapping[str, ViewMaps[np.ndarray]], config: Config, run: RunFolder
) -> Scene:
    """The scene whose photos know their exposure and white balance, where these vary (`scene.exposure`).

    Colours of vertices, seeds and sparse depth are then those of the mean exposure, and training compares a rendering
    with a photo as that was exposed. Stereo, features and the multi-view losses need no such help: they compare patches
    by their correlation, which no gain changes. metrics.json keeps the gains (`with_noted_exposure`).

    Args:
        maps: depth by frame name.

    Raises:
        InputError: a photo cannot be decoded.
    """
    from room2dgs.exposure.photos import gains_by_name, photo_gains, variation, with_gains

    if config.scene.exposure is False:
        run.record({"exposure": None})
        return scene
    with run.timed("exposure"):
        gains = photo_gains(scene.train, points.tracks, maps)
    if gains is None:
        run.log("exposure: photos share too few places to tell whether it varies")
        run.record({"exposure": None})
        return scene
    found = variation(gains)
    used = config.scene.exposure is True or max(found) >= LEAST
    run.log(
        f"exposure varies by ±{found.exposure:.0%}, white balance by ±{found.white_balance:.0%}: "
        f"{'levelled' if used else 'left as it is'}"
    )
    by_name = gains_by_name(scene, gains) if used else {}
    about = {"varies": found.exposure, "white_balance_varies": found.white_balance, "levelled": used}
    run.record({"exposure": {**about, GAINS: {name: list(factors) for name, factors in by_name.items()}}})
    return with_gains(scene, by_name) if used else scene


def with_noted_exposure(scene: Scene, out: Path) -> Scene:
    """The scene whose photos know the gains that a run in this folder found.

    Raises:
        InputError: metrics.json is damaged.
    """
    from room2dgs.exposure.photos import with_gains

    noted = (read_metrics(out).get("exposure") or {}).get(GAINS)
    return with_gains(scene, {name: (r, g, b) for name, (r, g, b) in noted.items()}) if noted else scene
