"""A study's runs: planned from the settings, each one a `room2dgs run` in a process and a folder of its own."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path

from room2dgs.config import Config, conf_dir, dump_config, load_config
from room2dgs.config.keys import leaf_keys
from room2dgs.config.sweep import Combination, combinations
from room2dgs.errors import InputError
from room2dgs.runs.folder import CONFIG, POINTS, PRIOR_MAPS, absolute, last_value
from room2dgs.runs.metrics import earlier

EXPERIMENT, SEED = "experiment", "train.seed"
OUT_OF_MEMORY = signal.SIGKILL  # how Linux ends a process that takes too much
COLOR_CODE = re.compile(r"\x1b\[[0-9;]*m")  # open3d colours its errors
LONGEST_REASON = 300  # characters


@dataclass(frozen=True)
class Job:
    """One run of a study.

    Attributes:
        row: the experiment, and what else was swept but the seed.
        config: all of its settings, paths absolute.
        overrides: those that make this config, `out` among them.
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
        InputError: none is named, or it holds something else.
    """
    given = last_value(list(argv), "out")
    if not given:
        raise InputError("out is not given; add out=DIR")
    out = Path(given).expanduser().absolute()
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; choose another out=DIR")
    if (out / CONFIG).exists() or (out.exists() and any(out.iterdir()) and not (out / marker).exists()):
        raise InputError(f"{out} is not empty and is not a study's folder; choose another out=DIR")
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
    for combination in combinations(overrides):
        job = _job(combination, out)
        twin = next((one for one in jobs if _settings(one.config) == _settings(job.config)), None)
        jobs.append(replace(job, same_as=twin.same_as or twin.row) if twin else job)
    return jobs


def finished(job: Job) -> bool:
    """Whether the folder holds this very run, whole to its scores.

    Raises:
        InputError: it holds a run with other settings.
    """
    path = job.folder / CONFIG
    if not path.is_file():
        return False
    other = _differing(absolute(load_config((), path)), job.config)
    if other:
        raise InputError(f"{job.folder} holds a run with another {other}; choose another out=DIR, or delete it")
    return "eval" in earlier(job.folder).get("seconds", {})


def executed(job: Job) -> str:
    """Runs it, or goes on with it, in a process of its own (peak memory is a process's); why it failed, or "".

    Raises:
        KeyboardInterrupt: it was interrupted.
    """
    begun = (job.folder / CONFIG).is_file()
    settings = (f"out={job.folder}", "resume=true") if begun else job.overrides
    command = [sys.executable, "-m", "room2dgs.cli", "run", *settings]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
    if done.returncode == 0:
        return ""
    if done.returncode in (130, -signal.SIGINT):
        raise KeyboardInterrupt
    if done.returncode < 0:
        said = " (out of memory?)" if -done.returncode == OUT_OF_MEMORY else ""
        return f"killed by signal {-done.returncode}{said}"
    lines = [line for line in COLOR_CODE.sub("", done.stderr).splitlines() if line.strip()]
    if not lines:
        return f"exit code {done.returncode}"
    return textwrap.shorten(lines[-1].removeprefix("room2dgs: "), LONGEST_REASON, placeholder=" ...")


def words_of(experiment: str) -> str:
    """What an experiment is: the first comment of its file."""
    path = conf_dir() / "experiment" / f"{experiment}.yaml"
    comments = (line.lstrip("# ") for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("#"))
    return next((line for line in comments if not line.startswith("@")), "")


def _job(combination: Combination, out: Path) -> Job:
    given = dict(text.partition("=")[::2] for text in combination.overrides)
    experiment = given.get(EXPERIMENT, "")
    others = [f"{key}={value}" for key, value in combination.chosen.items() if key not in (EXPERIMENT, SEED)]
    row = ", ".join([experiment, *others])
    # what every row would compute alike is kept once, at the study
    caches = {"points.cache": out / POINTS, "prior.cache": out / PRIOR_MAPS}
    shared = tuple(f"{key}={folder}" for key, folder in caches.items() if key not in given)
    seed = given.get(SEED, "")
    folder = out / re.sub(r"[^\w=.,+-]+", "_", row.replace(", ", ",")) / f"seed_{seed}"
    overrides = (*combination.overrides, *shared, f"out={folder}")
    return Job(row, experiment, absolute(load_config(overrides)), overrides)


def _settings(config: Config) -> str:
    """As text, which tells 1 from 1.0: in a schedule they differ."""
    return dump_config(replace(config, out="any", resume=False))


def _differing(one: Config, other: Config) -> str:
    """The first setting in which two runs differ, or an empty string."""
    for key in leaf_keys():
        path = key.name.split(".")
        if key.name not in ("out", "resume") and repr(reduce(getattr, path, one)) != repr(reduce(getattr, path, other)):
            return key.name
    return ""
