"""What a better or a worse prior brings in the mesh's score.

python -m room2dgs.tools.prior_error scene.path=DIR out=DIR
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.config import Config, load_config
from room2dgs.config.overrides import quoted
from room2dgs.depth.network.maps import read_models
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.json_files import read_json
from room2dgs.logs import Log, in_lines, run_log
from room2dgs.pipeline.evaluate import ground_truth
from room2dgs.pipeline.scene import read_capture
from room2dgs.runs.folder import POINTS, PRIOR_MAPS, absolute
from room2dgs.study.ablation import rows_of
from room2dgs.study.jobs import (
    SEED,
    Job,
    by_key,
    finished,
    path_as_it_stands,
    study_folder,
    swept_settings,
)
from room2dgs.study.launch import of_hydra
from room2dgs.study.progress import Progress, run_all, run_of
from room2dgs.tools.command_line import command_line
from room2dgs.tools.named_points import named_points
from room2dgs.tools.prior_error.curve import JSON, Curve, Point, Quality, write_tables
from room2dgs.tools.prior_error.page import HTML, write_page
from room2dgs.tools.simulate_priors import LIMITS, PriorOptions, simulate_priors

USAGE = (
    "python -m room2dgs.tools.prior_error scene.path=DIR out=DIR [factors=0.25,0.5,1,1.5,2] "
    "[point='NAME: KEY=VALUE ...'] [train.seed=0,1] [KEY=VALUE ...]"
)
HELP = """Runs the pipeline without priors, with simulated priors of several qualities, with pure noise, and with
real priors, and draws the F-score against the priors' measured errors.

A factor scales the errors of simulated maps: 1 has a depth AbsRel of 0.05 and normals 16 degrees off. Each
point='NAME: ...' is a real prior, given by its settings: point='ours: prior=room_prior'. Each run is a `room2dgs run`
(by default with experiment=quick) in a folder of its own; what is finished is not run again. The simulated maps are
made from the capture's true depth, and everything says so: the curve shows what a better network would bring.
"""
DEFAULTS = ("experiment=quick", f"{SEED}=0", "prior=room_prior")
OURS = ("out", "resume", "factors", "point")
FACTORS = (0.25, 0.5, 1.0, 1.5, 2.0)
UNIT = PriorOptions()  # what factor 1 is
NONE, NOISE = "no prior", "pure noise"
QUALITY_FRAMES = 24  # that a prior is measured on
SIMULATED = "simulated"  # the folder of the maps


@dataclass(frozen=True)
class Given:
    """One prior of the study.

    Attributes:
        name: of its row.
        overrides: its settings.
        options: how its maps are simulated; None: they are not.
        folder: of the simulated maps.
    """

    name: str
    overrides: tuple[str, ...]
    options: PriorOptions | None = None
    folder: Path | None = None


@command_line("prior_error")
def main(argv: list[str]) -> int:
    """Run, measure, draw.

    Returns:
        0, or the exit code of the first failed run's cause.

    Raises:
        InputError: settings that cannot be, a capture without depth or without a ground-truth mesh.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, HELP)
    out = study_folder(argv, JSON)
    priors = [*simulated_priors(argv, out), *real_priors(argv)]
    hydra_settings = [text for text in argv if of_hydra(text)]
    settings = [text for text in argv if text.partition("=")[0] not in OURS and text not in hydra_settings]
    jobs = planned(settings, priors, out)
    for group in jobs.values():
        read_models(group[0].config.prior)  # a network that is missing is reported now, not at its row
    progress = Progress([job for group in jobs.values() for job in group if not finished(job)])
    config = next(iter(jobs.values()))[0].config
    scene = read_capture(config)
    if not any(frame.depth_path for frame in scene.frames):
        raise InputError(f"{scene.path / 'depth'} has no depth maps; priors are simulated from, and measured on, them")
    if not (ground_truth(config) or scene.gt_mesh):
        raise InputError(f"{scene.path} has no gt_mesh.ply to score against; give eval.gt=MESH")
    out.mkdir(parents=True, exist_ok=True)
    command = shlex.join(["python", "-m", "room2dgs.tools.prior_error", *argv])

    def so_far() -> Curve:
        return _curve(jobs, priors, progress, command, out)

    write_tables(so_far(), out)  # first: it marks the folder as a study's
    log = run_log(out)
    in_lines(log, f"{command}\n{sum(map(len, jobs.values()))} runs, {len(progress.todo)} to come")
    for prior in priors:
        _prepare(prior, jobs[prior.name][0].config, out, log)
        run_all(progress, jobs[prior.name], hydra_settings, out, log, lambda: write_tables(so_far(), out))
    in_lines(log, f"\n{write_tables(so_far(), out)}")
    write_page(so_far(), out)
    log(f"the curve: {out / HTML}")
    return progress.code


def simulated_priors(argv: Sequence[str], out: Path) -> list[Given]:
    """No prior, a simulated one for each factor, and noise.

    Raises:
        InputError: `factors` is no list of positive numbers, or one of them is too large.
    """
    text = _last(argv, "factors")
    try:
        factors = FACTORS if text is None else tuple(float(part) for part in text.split(",") if part)
    except ValueError as error:
        raise InputError(f"factors={text} is no list of numbers; give for example factors=0.5,1,2") from error
    largest = min(LIMITS[name][1] / getattr(UNIT, name) for name in ("abs_rel", "normal_deg", "edge_blur"))
    if not all(0 < factor <= largest for factor in factors):
        raise InputError(
            f"factors={text} is impossible; each is above 0 and at most {math.floor(100 * largest) / 100:g}"
        )
    found = [Given(NONE, ("prior=none",))]
    for factor in sorted(set(factors)):
        options = replace(
            UNIT,
            abs_rel=factor * UNIT.abs_rel,
            normal_deg=factor * UNIT.normal_deg,
            edge_blur=factor * UNIT.edge_blur,
        )
        found.append(_simulated(f"simulated x {factor:g}", options, out / SIMULATED / f"x{factor:g}"))
    return [*found, _simulated(NOISE, replace(UNIT, noise_only=True), out / SIMULATED / "noise")]


def real_priors(argv: Sequence[str]) -> list[Given]:
    """The priors that `point` names.

    Raises:
        InputError: as `named_points`.
    """
    found = named_points(argv, (NONE, NOISE))
    taken = next((name for name in found if name.startswith(SIMULATED)), None)
    if taken:
        raise InputError(f"point={taken!r}: names that begin with {SIMULATED} are taken; choose another")
    return [Given(name, overrides) for name, overrides in found.items()]


def planned(overrides: Sequence[str], priors: Sequence[Given], out: Path) -> dict[str, list[Job]]:
    """Row -> its runs, one for each random seed.

    Args:
        overrides: settings that all rows share; `train.seed` may be a list.

    Raises:
        InputError: settings that cannot be, or another list.
    """
    several, swept = swept_settings([*DEFAULTS, *overrides])
    other = next((key for key in swept if key != SEED), None)
    if other:
        raise InputError(f"{other} is a list; give one value, only {SEED} may have several")
    return {prior.name: [_job(prior, shared, out) for shared in several] for prior in priors}


def _job(prior: Given, shared: Mapping[str, str], out: Path) -> Job:
    given = {**shared, **by_key(prior.overrides)}
    caches = {"points.cache": out / POINTS, "prior.cache": out / PRIOR_MAPS}
    folder = out / "runs" / _file_name(prior.name) / f"seed_{given[SEED]}"
    overrides = (
        *(path_as_it_stands(f"{key}={value}") for key, value in given.items()),
        *(f"{key}={quoted(str(path))}" for key, path in caches.items() if key not in given),
    )
    return Job(prior.name, given.get("experiment", ""), absolute(load_config([*overrides, f"out={folder}"])), overrides)


def _simulated(name: str, options: PriorOptions, folder: Path) -> Given:
    paths = (f"prior.depth.path={folder / 'depth'}", f"prior.normal.path={folder / 'normal'}")
    return Given(name, ("prior=files", *paths), options, folder)


def _prepare(prior: Given, config: Config, out: Path, log: Log) -> None:
    """Make the simulated maps and measure the prior, unless both are there."""
    if prior.options and prior.folder and _made_with(prior.folder) != dataclasses.asdict(prior.options):
        log(f"{prior.name}: making the maps from the true depth")
        simulate_priors(Path(config.scene.path), prior.folder, prior.options, overwrite=True)
    path, known_by = _quality_path(prior, out), _known_by(prior, config)
    if prior.name == NONE or _read(path).get("known_by") == known_by:
        return
    from room2dgs.bench.prior import measured_scenes

    frames = QUALITY_FRAMES if config.scene.frames is None else min(QUALITY_FRAMES, config.scene.frames)
    scene = replace(config.scene, frames=frames, stride=1, test_every=0)
    (score,) = measured_scenes([scene], config.prior, log)
    depth = score.depth.get("scale_shift")
    abs_rel, delta1 = (depth.abs_rel, depth.delta1) if depth else (None, None)
    quality = Quality(abs_rel, delta1, score.normals.get("mean_deg"), score.frames)
    with whole_file(path) as temporary:
        whole = {"known_by": known_by, "quality": dataclasses.asdict(quality)}
        temporary.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")


def _known_by(prior: Given, config: Config) -> dict[str, Any]:
    """What a measured quality depends on."""
    found = {
        "prior": dataclasses.asdict(replace(config.prior, cache=None, threads=None)),
        "models": {kind: model.digest for kind, model in read_models(config.prior).items()},
        "made_with": prior.options and dataclasses.asdict(prior.options),
        "scene": dataclasses.asdict(config.scene),
    }
    return json.loads(json.dumps(found))


def _made_with(folder: Path) -> dict[str, Any] | None:
    return _read(folder / "priors.json").get("options")


def _quality_path(prior: Given, out: Path) -> Path:
    return out / "quality" / f"{_file_name(prior.name)}.json"


def _file_name(row: str) -> str:
    return re.sub(r"[^\w.+-]+", "_", row)


def _read(path: Path) -> dict[str, Any]:
    try:
        return read_json(path)
    except InputError:
        return {}


def _curve(
    jobs: dict[str, list[Job]],
    priors: Sequence[Given],
    progress: Progress,
    command: str,
    out: Path,
) -> Curve:
    """The study so far."""
    config = next(iter(jobs.values()))[0].config
    runs = [run_of(job, progress) for group in jobs.values() for job in group]
    points = []
    for prior, row in zip(priors, rows_of(runs, {}, config.eval.threshold_m), strict=True):
        quality = _read(_quality_path(prior, out)).get("quality")
        kind = {NONE: "none", NOISE: "noise"}.get(prior.name, "simulated" if prior.options else "real")
        points.append(Point(kind, row, Quality(**quality) if quality else None))
    title = f"What a prior's errors cost on {Path(config.scene.path).name}"
    return Curve(title, command, config.eval.threshold_m, tuple(points))


def _last(argv: Sequence[str], key: str) -> str | None:
    return next((text.partition("=")[2] for text in reversed(argv) if text.startswith(key + "=")), None)


if __name__ == "__main__":
    sys.exit(main())
