"""Hydra's own multirun: its sweeper makes the combinations, its launcher runs the jobs.

A job is a `room2dgs run` in a process of its own, because peak memory is a process's and a crash ends only one.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from hydra import version as hydra_version
from hydra._internal.callbacks import Callbacks
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra._internal.hydra import Hydra
from hydra._internal.utils import create_config_search_path
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.errors import HydraException
from hydra.types import HydraContext, RunMode
from omegaconf import DictConfig

from room2dgs.config import conf_dir, load_config
from room2dgs.config.composing import hydra_to_itself
from room2dgs.config.overrides import group_choices, known_key, quoted
from room2dgs.config.sentences import of_composition
from room2dgs.errors import InputError, RunFailed
from room2dgs.interrupts import Terminated
from room2dgs.runs.metrics import read_metrics

BASIC = "hydra._internal.core_plugins.basic_launcher.BasicLauncher"  # one job after the other
COLOR_CODE = re.compile(r"\x1b\[[0-9;]*m")  # open3d colours its errors
LONGEST_REASON = 300  # characters
PATIENCE_S = 60  # for a job that was told to end


def of_hydra(override: str) -> bool:
    """Is it a setting of Hydra's own (`hydra/launcher=joblib`, `hydra.sweep.subdir=...`)?"""
    return re.match(r"\+*hydra[./]", override) is not None


def combinations(overrides: Sequence[str]) -> list[tuple[str, ...]]:
    """Every combination of what are lists (`a,b`, `range(0,3)`), each once, as Hydra's basic sweeper makes them.

    The first key changes slowest; a key that comes again takes the place of the earlier one.

    Raises:
        InputError: not KEY=VALUE, an unknown key, or values that Hydra cannot read.
    """
    groups = group_choices(conf_dir())
    for text in overrides:
        known_key(text, groups)
    try:
        (found,) = BasicSweeper.split_arguments(OverridesParser.create().parse_overrides(list(overrides)), None)
    except HydraException as error:
        raise InputError(of_composition(error)) from error
    return list(dict.fromkeys(map(tuple, found)))


def multirun(overrides: Sequence[str], out: Path) -> None:
    """Hydra's sweeper over `overrides` and its own settings among them; each job in a folder below `out`.

    With Hydra's own sweeper all settings are checked before the first job starts.

    Raises:
        InputError: settings that cannot be.
        RunFailed: the first job that failed; those that Hydra launched with it went on.
    """
    _check_folder(out)
    ours = [text for text in overrides if not of_hydra(text)]
    if not any(text.startswith("hydra/sweeper=") for text in overrides):
        for combination in combinations(ours):
            load_config([*combination, f"out={out}"])
    everything = [*overrides, f"out={quoted(str(out))}"]
    with _hydra() as hydra:
        hydra.multirun("config", job, everything, with_log_configuration=False)


def launched(jobs: Sequence[Sequence[str]], hydra_settings: Sequence[str], out: Path) -> list[RunFailed | None]:
    """Hydra's launcher runs the jobs; why each failed, None for those that did not.

    Args:
        jobs: settings of each, its folder `out` among them.
        hydra_settings: of Hydra's own, e.g. "hydra/launcher=joblib".
        out: where the launcher keeps what is its own.

    Raises:
        KeyboardInterrupt: a job was interrupted.
    """
    _check_folder(out)
    settings = [*hydra_settings, "hydra/hydra_logging=none", f"out={quoted(str(out))}", "hydra.sweep.subdir=."]
    with _hydra() as hydra:
        config = hydra.compose_config("config", settings, RunMode.MULTIRUN, with_log_configuration=False)
        context = HydraContext(config_loader=hydra.config_loader, callbacks=Callbacks(config))
        launcher = Plugins.instance().instantiate_launcher(hydra_context=context, task_function=job, config=config)
        return [_failure(done) for done in launcher.launch(jobs, initial_job_idx=0)]


def in_turn(hydra_settings: Sequence[str]) -> bool:
    """Does the launcher that the settings choose run one job after the other?"""
    return _in_turn(tuple(hydra_settings))


@lru_cache(maxsize=8)
def _in_turn(hydra_settings: tuple[str, ...]) -> bool:
    settings = [*hydra_settings, "out=any"]
    with _hydra() as hydra:
        config = hydra.compose_config("config", settings, RunMode.MULTIRUN, with_log_configuration=False)
        return config.hydra.launcher._target_ == BASIC


def job(config: DictConfig) -> float:
    """One job of Hydra's: `room2dgs run` into the job's folder.

    Returns:
        The F-score, for sweepers that look for the best settings; NaN without a ground truth.

    Raises:
        RunFailed: why, with its exit code.
        KeyboardInterrupt: it was interrupted.
    """
    hydra = HydraConfig.get()
    folder = Path(hydra.runtime.output_dir)
    settings = [text for text in hydra.overrides.task if text.partition("=")[0] != "out"]
    _checked(ended([sys.executable, "-m", "room2dgs.cli", "run", *settings, f"out={folder}"]))
    metrics = read_metrics(folder)
    scores = (value for name, value in metrics.items() if name.startswith("f_score_") and value is not None)
    return float(next(scores, "nan"))


def ended(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """The process after its end; when we are interrupted it is told to end too, and waited for."""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, errors="replace") as process:
        try:
            said = process.communicate()[1]
        except BaseException:
            process.terminate()
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, None, said)


def _check_folder(out: Path) -> None:
    """Hydra reads the folder of several runs twice, the second time as a pattern.

    Raises:
        InputError: it would read another folder.
    """
    if "${" in str(out):
        raise InputError(
            f"{out} cannot hold several runs: Hydra takes ${{ in their folder for a value; choose another out=DIR"
        )


def _checked(done: subprocess.CompletedProcess[str]) -> None:
    if done.returncode in (130, -signal.SIGINT):
        raise KeyboardInterrupt
    if done.returncode in (143, -signal.SIGTERM):
        raise Terminated
    if done.returncode < 0:
        said = " (out of memory?)" if -done.returncode == signal.SIGKILL else ""  # so Linux ends what takes too much
        raise RunFailed(f"killed by signal {-done.returncode}{said}", 128 - done.returncode)
    if done.returncode:
        lines = [line for line in COLOR_CODE.sub("", done.stderr).splitlines() if line.strip()]
        why = lines[-1].removeprefix("room2dgs: ") if lines else f"exit code {done.returncode}"
        raise RunFailed(textwrap.shorten(why, LONGEST_REASON, placeholder=" ..."), done.returncode)


def _failure(done: JobReturn) -> RunFailed | None:
    if done.status is JobStatus.COMPLETED:
        return None
    cause = done._return_value  # its property would print what we say ourselves
    if not isinstance(cause, RunFailed):
        raise cause
    return cause


@contextmanager
def _hydra() -> Iterator[Hydra]:
    with hydra_to_itself():
        hydra_version.setbase("1.3")
        try:
            yield Hydra.create_main_hydra2("room2dgs", create_config_search_path(str(conf_dir().resolve())))
        except HydraException as error:
            raise InputError(of_composition(error)) from error
