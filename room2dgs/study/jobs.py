"""A study's runs: planned from the settings, each one a `room2dgs run` in a process and a folder of its own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os.path import relpath
from pathlib import Path

from room2dgs.config import Config, conf_dir, load_config
from room2dgs.config.keys import leaf_keys, path_keys
from room2dgs.config.overrides import quoted
from room2dgs.errors import InputError, RunFailed
from room2dgs.files import is_temporary
from room2dgs.owner import LOCK, refuse_if_owned
from room2dgs.runs.folder import CONFIG, POINTS, PRIOR_MAPS, absolute, last_value, value_at
from room2dgs.runs.metrics import read_metrics
from room2dgs.study.launch import combinations, in_turn, launched

EXPERIMENT, SEED = "experiment", "train.seed"
CACHES = ("points.cache", "prior.cache")  # what is kept there is known by what it was made of


@dataclass(frozen=True)
class Job:
    """One run of a study.

    Attributes:
        row: the experiment, and what else was swept but the seed.
        config: all of its settings, paths absolute.
        overrides: those that make this config, without `out`.
        same_as: the earlier row that has the same settings, or an empty string.
    """

    row: str
    experiment: str
    config: Config
    overrides: tuple[str, ...]
    same_as: str = ""

    @property
    def folder(self) -> Path:
        return Path(self.config.out)

    @property
    def seed(self) -> int:
        return self.config.train.seed


def study_folder(argv: Sequence[str], marker: str) -> Path:
    """The folder that `out` names, absolute: new, empty, or an earlier study's.

    Args:
        marker: the file that an earlier study left there.

    Raises:
        InputError: none is named, it holds something else, or another process works there.
    """
    given = last_value(list(argv), "out")
    if not given:
        raise InputError("out is not given; add out=DIR")
    out = Path(given).expanduser().absolute()
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; choose another out=DIR")
    other = out.exists() and any(path.name != LOCK and not is_temporary(path.name) for path in out.iterdir())
    if (out / CONFIG).exists() or (other and not (out / marker).exists()):
        raise InputError(f"{out} is not empty and is not a study's folder; choose another out=DIR")
    refuse_if_owned(out)
    return out


def planned(overrides: Sequence[str], out: Path) -> list[Job]:
    """All combinations, checked; the first swept key changes slowest.

    Args:
        overrides: settings with lists of choices, without `out` and `resume`.
        out: the study's folder, absolute.

    Raises:
        InputError: settings that cannot be.
    """
    jobs: list[Job] = []
    first: dict[str, Job] = {}
    several, swept = swept_settings(overrides)
    for given in several:
        job = _job(given, [key for key in swept if key not in (EXPERIMENT, SEED)], out)
        twin = first.setdefault(_settings(job.config), job)
        jobs.append(job if twin is job else replace(job, same_as=twin.row))
    return jobs


def swept_settings(overrides: Sequence[str]) -> tuple[list[dict[str, str]], list[str]]:
    """Every combination as key -> value, and the keys that differ among them. Paths are one value, commas and all."""
    several = [by_key(combination) for combination in combinations([path_as_it_stands(text) for text in overrides])]
    return several, [key for key in several[0] if len({given[key] for given in several}) > 1]


def finished(job: Job) -> bool:
    """Whether the folder holds this very run, whole to its scores.

    Raises:
        InputError: it holds a run with other settings.
    """
    path = job.folder / CONFIG
    if not path.is_file():
        return False
    other = _differing(_saved(job), job.config)
    if other:
        raise InputError(f"{job.folder} holds a run with another {other}; choose another out=DIR, or delete it")
    try:
        return "eval" in (read_metrics(job.folder).get("seconds") or {})
    except InputError:  # figures that are not whole: the run is gone on with, and says so itself
        return False


def _saved(job: Job) -> Config:
    """As its folder has them, wherever that was then."""
    return absolute(load_config((), job.folder / CONFIG))


def executed(jobs: Sequence[Job], hydra_settings: Sequence[str], out: Path) -> list[RunFailed | None]:
    """Runs them, or goes on with them, by Hydra's launcher; why each failed, or None.

    Raises:
        KeyboardInterrupt: one was interrupted.
    """
    begun = [(job.folder / CONFIG).is_file() for job in jobs]
    # the study may have been moved since
    places = [_places(job) if resumes else [] for job, resumes in zip(jobs, begun, strict=True)]
    folders = [f"out={quoted(str(job.folder))}" for job in jobs]
    settings = [
        [*elsewhere, folder, "resume=true"] if resumes else [*job.overrides, folder]
        for job, folder, resumes, elsewhere in zip(jobs, folders, begun, places, strict=True)
    ]
    return launched(settings, hydra_settings, out)


def batches(jobs: Sequence[Job], hydra_settings: Sequence[str]) -> list[list[Job]]:
    """What is launched together: one after the other, or all at once by a launcher that runs them at the same time."""
    if not in_turn(hydra_settings):
        return [list(jobs)] if jobs else []
    return [[job] for job in jobs]


def words_of(experiment: str) -> str:
    """What an experiment is: the first comment of its file."""
    path = conf_dir() / "experiment" / f"{experiment}.yaml"
    comments = (line.lstrip("# ") for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("#"))
    return next((line for line in comments if not line.startswith("@")), "")


def _job(given: dict[str, str], swept: Sequence[str], out: Path) -> Job:
    row = ", ".join([given.get(EXPERIMENT, ""), *(f"{key}={given[key]}" for key in swept)])
    # what every row would compute alike is kept once, at the study
    caches = {"points.cache": out / POINTS, "prior.cache": out / PRIOR_MAPS}
    shared = (f"{key}={quoted(str(folder))}" for key, folder in caches.items() if key not in given)
    overrides = (*(f"{key}={value}" for key, value in given.items()), *shared)
    folder = out / re.sub(r"[^\w=.,+-]+", "_", row.replace(", ", ",")) / f"seed_{given.get(SEED, '')}"
    return Job(row, given.get(EXPERIMENT, ""), absolute(load_config([*overrides, f"out={folder}"])), overrides)


def by_key(combination: Sequence[str]) -> dict[str, str]:
    return dict(text.partition("=")[::2] for text in combination)


def path_as_it_stands(text: str) -> str:
    """A path is one value, commas and all."""
    key, equals, value = text.partition("=")
    return f"{key}={quoted(value)}" if equals and key in path_keys() else text


def _places(job: Job) -> list[str]:
    """Settings for the paths that are elsewhere than the run's folder says."""
    saved = _saved(job)
    values = {key: value_at(job.config, key) for key in path_keys() if key != "out"}
    return [f"{key}={quoted(value)}" for key, value in values.items() if value and value != value_at(saved, key)]


def _settings(config: Config) -> str:
    """As text, which tells 1 from 1.0: in a schedule they differ."""
    return repr(replace(config, out="any", resume=False))


def _differing(one: Config, other: Config) -> str:
    """The first setting in which two runs differ, or an empty string.

    A path is the same where it lies in the same place, or as far from the run as before: a study moved as a whole is
    the same study.
    """
    for key in (leaf.name for leaf in leaf_keys() if leaf.name not in ("out", "resume", *CACHES)):
        before, now = value_at(one, key), value_at(other, key)
        moved = before and now and key in path_keys() and relpath(before, one.out) == relpath(now, other.out)
        if repr(before) != repr(now) and not moved:
            return key
    return ""
