"""The last step of a run: what it says of itself, by measures that need no ground truth."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.left_out import some
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.units import SCALE
from room2dgs.registries.meshers import MESHERS
from room2dgs.runs.depth_coverage import SURE
from room2dgs.runs.folder import MESH, PRIORS, TRUST
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.schema import is_number
from room2dgs.runs.trust import read_trust
from room2dgs.runs.verdict import LEAST_SCALES, VERDICT, Measures, Verdict, verdict_of

MAX_HELD_OUT = 20  # views whose nearest photo is looked at
SCALE_QUANTILES = 0.05, 0.95
SMALLEST_SCALE = 1e-6  # fits may give 0 or less, which has no ratio


def judge_run(scene: Scene, config: Config, run: RunFolder) -> Verdict:
    """Measure what the run has made and note the verdict in metrics.json.

    Args:
        scene: with the poses that the run worked with.

    Raises:
        InputError: no mesh, a damaged file, or a photo that cannot be read.
    """
    with run.timed("verdict"):
        verdict = replace(verdict_of(measures_of(scene, config, run.path)), notes=notes_on(scene))
    run.record({VERDICT: verdict.as_dict()})
    return verdict


def measures_of(scene: Scene, config: Config, out: Path) -> Measures:
    """What the folder of a run and its capture tell.

    Raises:
        InputError: as `judge_run`.
    """
    from room2dgs.eval.surface import Surface
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.runs.mesh_against_photos import SmallView, mesh_coverage, photo_agreement, small_view

    metrics = read_metrics(out)
    surface = Surface(read_in_scene(out / MESH, scene.origin_m))

    @cache
    def view(index: int) -> SmallView:
        return small_view(scene.train[index], surface)

    psnr_db = metrics.get("psnr_db")
    # what other networks give has a scale of its own in every view
    in_metres = config.mesh.with_priors and config.prior.depth.meaning == "metric_depth"
    made_of = MESHERS.get(config.mesh.source).facts
    return Measures(
        coverage=mesh_coverage(scene.train, view),
        photo_agreement=photo_agreement(scene.train, view),
        psnr_db=psnr_db,
        nearest_psnr_db=None if psnr_db is None else _nearest_psnr_db(scene),
        stereo_coverage=metrics.get("stereo_coverage"),
        points=metrics.get("points"),
        trusted=_trusted(out) if config.mesh.with_priors else None,
        scale_ratio=scale_ratio(out / PRIORS) if in_metres else None,
        left_out=left_out_share(scene),
        prior_scale=_positive(metrics.get(SCALE)),
        unit=_positive(config.scene.unit),
        points_alone=not (made_of["reads_priors"] or made_of["needs_stereo"]),
    )


def notes_on(scene: Scene) -> tuple[str, ...]:
    """Photos that were left out, by name, however few."""
    if not scene.dropped:
        return ()
    first, count = scene.dropped[0], len(scene.dropped)
    of = count + len(scene.frames) + scene.not_chosen
    whose = "of the first: " if count > 1 else ""
    names = some([one.name for one in scene.dropped])
    return (f"{count} of {of} photos left out: {names} ({whose}{first.reason})",)


def left_out_share(scene: Scene) -> float:
    """Share of the capture's photos that cannot be used; what `scene.frames` leaves aside can be."""
    lost = len(scene.dropped)
    return lost / (lost + len(scene.frames) + scene.not_chosen)


def scale_ratio(path: Path) -> float | None:
    """Spread of the scales in a run's priors.csv (`Measures.scale_ratio`); None without the file or with few views."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        scales = np.array([float(row["scale"]) for row in rows], dtype=np.float64)
    except (OSError, KeyError, TypeError, ValueError):
        return None
    scales = scales[np.isfinite(scales)]
    if len(scales) < LEAST_SCALES:
        return None
    low, high = np.quantile(np.maximum(scales, SMALLEST_SCALE), SCALE_QUANTILES)
    return float(high / low)


def nearest(frame: Frame, others: tuple[Frame, ...]) -> Frame:
    """The view whose photo is most like a frame's: near to it, and turned the same way."""
    camera = frame.camera

    def distance(other: Frame) -> float:
        way = np.linalg.norm(other.camera.centre - camera.centre)
        return float(way + 2 * np.linalg.norm(other.camera.forward - camera.forward))  # a turn of 30 degrees as 1 m

    return min(others, key=distance)


def _nearest_psnr_db(scene: Scene) -> float | None:
    import cv2

    from room2dgs.eval.image_metrics import psnr

    values = []
    for frame in evenly_spaced(scene.test, MAX_HELD_OUT):
        photo = nearest(frame, scene.train).color()
        if photo.shape[1::-1] != frame.camera.size:
            photo = cv2.resize(photo, frame.camera.size, interpolation=cv2.INTER_AREA)
        values.append(psnr(photo, frame.color(), frame.mask()))
    return float(np.mean(values)) if values else None


def _trusted(out: Path) -> float | None:
    maps = read_trust(out / TRUST)
    if not maps:
        return None
    return float(np.mean([(one.confidence >= 255 * SURE).mean() for one in maps.values()]))


def _positive(value: Any) -> float | None:
    return float(value) if is_number(value) and value > 0 else None
