"""A run at another scale, by a known length: all its files follow, together or not at all."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.world_offset import AT_ORIGIN
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.json_files import read_json
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.export import source_of
from room2dgs.pipeline.measure import measured_run
from room2dgs.pipeline.plan import PLAN
from room2dgs.pipeline.points import points_cache
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.pipeline.unit_estimate import UNIT
from room2dgs.pipeline.units import SCALE
from room2dgs.registries.exporters import EXPORTERS, place_of
from room2dgs.runs.folder import (
    BOUNDARY,
    CHECKPOINTS,
    EVAL,
    EXPORTS,
    MESH,
    METRICS,
    MIRRORS,
    POSES,
    PRIORS,
    REPORT,
    SURFELS,
    TEXTURED,
    TRUST,
    at_work,
    earlier_run,
    required,
    write_config,
)
from room2dgs.runs.metrics import MESH_SCORES, read_metrics
from room2dgs.runs.mirrors import scaled_mirrors
from room2dgs.runs.replacing import commit, finish, left, note_left, staging

TAPE_M = 0.005  # of a known length that nobody said the error of
FACTORS = 1e-4, 1e4  # that a scale may change by
LEAST_SHARE = 0.2  # of a known length: what it may be unsure by


@dataclass(frozen=True)
class Rescaling:
    """How a run is scaled.

    Attributes:
        factor: of all lengths.
        sigma: relative deviation of the new scale.
        words: a sentence for the log.
    """

    factor: float
    sigma: float
    words: str


def rescaling_of(config: Config, one: str, other: str, length: str, log: Log = to_terminal) -> Rescaling:
    """From two ends that a person has measured between.

    Args:
        one, other: as `lengths.targets` reads them.
        length: metres, with its deviation if that is known: "2.04+-0.005".

    Raises:
        InputError: as `MeasuredRun.between`, or the length is too unsure to say anything.
    """
    from room2dgs.lengths.targets import length_of, target_of

    metres, given = length_of(length, "length")
    run = measured_run(config, log, 0.0)
    found = run.between(target_of(one), target_of(other))
    tape = TAPE_M if given is None else given
    surface = float(np.hypot(found.surface_m, found.fit_m))
    sigma = float(np.hypot(tape / metres, surface / found.value)) if found.value > 0 else np.inf
    if not sigma < LEAST_SHARE:
        raise InputError(
            f"{one} and {other} are {found.value:.3g} ± {surface:.2g} apart, which is too short to scale by; choose "
            "two that are far apart"
        )
    factor = metres / found.value
    if not FACTORS[0] <= factor <= FACTORS[1]:
        raise InputError(f"length={length} would make the run {factor:.3g} times as large; check its unit, metres")
    words = f"scale: {found.value:.4g} between {one} and {other} are {metres:g} m: all lengths times {factor:.5g}, "
    return Rescaling(factor, sigma, words + f"± {sigma:.2%}")


def rescale_run(config: Config, rescaling: Rescaling | None, log: Log = to_terminal) -> None:
    """Scales all files of the run in config.out, and makes report, plan and exports again that were there.

    Args:
        rescaling: None: only what was stopped is finished.

    Raises:
        InputError: the run is not finished, lies far from its world's origin, or a file is damaged.
    """
    with at_work(config) as out:
        finish(out)
        if rescaling is not None:
            log(rescaling.words)
            points = _kept_points(config, out)
            _stage(config, out, rescaling)
            commit(out, _removed(out), _later(out, config.export.up))
            _keep_points(points, rescaling.factor, out)
        _make_again(out, log)


def _kept_points(config: Config, out: Path) -> PointCloud | None:
    """The sparse points that were triangulated in the run; None: there are none, or they are the capture's."""
    if config.points.source == "file" or not any(points_cache(config, out).glob("points-*.safetensors")):
        return None
    return source_of(config, _silent).points


def _keep_points(points: PointCloud | None, factor: float, out: Path) -> None:
    """So that nobody triangulates them again; killed before, somebody does."""
    from room2dgs.captures.in_metres import scaled_points
    from room2dgs.sfm.sparse import keep_points

    if points is not None:
        config = earlier_run([f"out={out}"])
        scene = scene_of_run(config)
        keep_points(scene, config.points, points_cache(config, out), scaled_points(points, factor))


def _silent(line: str) -> None:
    """Takes a line about points that are only carried on."""


def _stage(config: Config, out: Path, rescaling: Rescaling) -> None:
    """The new files, beside the old."""
    from room2dgs.lengths.scaled_files import scaled_glb, scaled_ply, scaled_trust
    from room2dgs.train.surfel_file import scaled_surfel_file

    required(out / MESH, "mesh")
    factor, metrics = rescaling.factor, read_metrics(out)
    if tuple((metrics.get("capture") or {}).get("origin_m", AT_ORIGIN)) != AT_ORIGIN:
        raise InputError(f"{out} lies far from the origin of its world, so its coordinates are metres of a map already")
    poses = read_json(required(out / POSES, "run"))
    unit = _unit(config, poses) * factor
    place = staging(out)
    saved = earlier_run([f"out={out}"])
    write_config(place, replace(saved, scene=replace(saved.scene, unit=unit)))
    for name in (MESH, BOUNDARY):
        if (out / name).is_file():
            (place / name).write_bytes(scaled_ply((out / name).read_bytes(), factor, str(out / name)))
    if (out / TEXTURED).is_file():
        (place / TEXTURED).write_bytes(scaled_glb((out / TEXTURED).read_bytes(), factor, str(out / TEXTURED)))
    if (out / SURFELS).is_file():
        scaled_surfel_file(out / SURFELS, place / SURFELS, factor)
    if (out / TRUST).is_file():
        (place / TRUST).write_bytes(scaled_trust((out / TRUST).read_bytes(), factor))
    if (out / PRIORS).is_file():
        (place / PRIORS).write_text(_scaled_priors((out / PRIORS).read_text(encoding="utf-8"), factor), "utf-8")
    if (out / MIRRORS).is_file():
        _write(place / MIRRORS, scaled_mirrors(out / MIRRORS, factor))
    _write(place / POSES, _scaled_poses(poses, factor))
    _write(place / METRICS, _scaled_metrics(metrics, unit, rescaling))


def _unit(config: Config, poses: dict[str, Any]) -> float:
    """Metres of one unit of the capture, as the run has it so far."""
    given = config.scene.given_unit
    estimated = (poses.get("unit") or {}).get("metres", 1.0)
    return float(given if given is not None else estimated)


def _scaled_poses(poses: dict[str, Any], factor: float) -> dict[str, Any]:
    """From here on scene.unit has the unit, and an estimate is none any more."""

    def scaled(rows: list[list[float]]) -> list[list[float]]:
        matrix = np.array(rows, np.float64)
        matrix[:3, 3] *= factor
        return matrix.tolist()

    report = dict(poses.get("report") or {})
    if report.get("moved_m") is not None:
        report["moved_m"] = factor * report["moved_m"]
    frames = {
        name: {which: scaled(rows) for which, rows in two.items()} for name, two in poses["cam_from_world"].items()
    }
    kept = {key: value for key, value in poses.items() if key != "unit"}
    return {**kept, "report": report, "cam_from_world": frames}


def _scaled_metrics(metrics: dict[str, Any], unit: float, rescaling: Rescaling) -> dict[str, Any]:
    """Scores against a truth were those of the old scale."""
    factor = rescaling.factor
    found: dict[str, Any] = {key: None if key.startswith(MESH_SCORES) else value for key, value in metrics.items()}
    for key in ("mesh_voxel_m", SCALE):
        if found.get(key) is not None:
            found[key] = factor * found[key]
    if isinstance(found.get("boundary_m"), dict):
        found["boundary_m"] = {kind: factor * metres for kind, metres in found["boundary_m"].items()}
    if isinstance(found.get("poses"), dict) and found["poses"].get("moved_m") is not None:
        found["poses"] = {**found["poses"], "moved_m": factor * found["poses"]["moved_m"]}
    if isinstance(found.get("capture"), dict):
        found["capture"] = {**found["capture"], "metric": True}
    found[UNIT] = {"metres": unit, "source": "known length", "sigma": rescaling.sigma}
    return found


def _scaled_priors(text: str, factor: float) -> str:
    """priors.csv: scale and shift bring a map to the run's metres."""
    rows = list(csv.DictReader(io.StringIO(text)))
    if not rows:
        return text
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        for key in ("scale", "shift"):
            if row.get(key):
                row[key] = f"{factor * float(row[key]):.6g}"
        writer.writerow(row)
    return stream.getvalue()


def _write(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _removed(out: Path) -> list[str]:
    """What is of the old scale, and is made again or no longer of use."""
    return [name for name in (CHECKPOINTS, EVAL, REPORT, PLAN, EXPORTS) if (out / name).exists()]


def _later(out: Path, up: str) -> dict[str, Any]:
    """What was there and is to be made again, with the same side up."""
    exports = [one.name for one in EXPORTERS.entries() if (out / EXPORTS / place_of(one)).exists()]
    return {
        "up": up,
        **({"exports": exports} if exports else {}),
        **({"plan": True} if (out / PLAN).exists() else {}),
        **({"report": True} if (out / REPORT).exists() else {}),
    }


def _make_again(out: Path, log: Log) -> None:
    """One after the other; what is done is noted, so that a stopped command goes on."""
    from room2dgs.pipeline.export import export_run
    from room2dgs.pipeline.loaded_run import loaded_run
    from room2dgs.pipeline.plan import write_plan
    from room2dgs.pipeline.report import write_run_report

    later = left(out)
    config = earlier_run([f"out={out}", f"export.up={later.pop('up', 'auto')}"])
    if "exports" in later:
        export_run(config, later.pop("exports"), None, log)
        note_left(out, {**later, "up": config.export.up})
    if "plan" in later:
        write_plan(config, None, log)
        later.pop("plan")
        note_left(out, {**later, "up": config.export.up})
    if "report" in later:
        with loaded_run(config, log) as (scene, surfels, run):
            write_run_report(scene, surfels, config, run)
    note_left(out, {})
