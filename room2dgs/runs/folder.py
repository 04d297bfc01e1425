"""A run's folder: made once, never by accident over another's, cleared again when nothing came of it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import reduce
from pathlib import Path

from room2dgs.config import Config, dump_config, load_config
from room2dgs.config.keys import path_keys
from room2dgs.errors import InputError
from room2dgs.files import whole_file

CONFIG, MESH, METRICS = "config.yaml", "mesh.ply", "metrics.json"
SURFELS, CHECKPOINTS, POINTS, RENDERS = "surfels.safetensors", "checkpoints", "points", "renders"
PRIORS, PRIOR_MAPS, CACHE, POSES = "priors.csv", "priors", "cache", "poses.json"
REPORT, TRUST, EXPORTS = "report.html", "trust.npz", "export"
CAPTURE = "capture"  # what `run video=...` made of the video, before the run itself


def new_run(overrides: list[str]) -> Config:
    """The settings of `run` and `train`; with resume=true those of the run in `out`, overrides on top.

    Raises:
        InputError: settings that cannot be, or an `out` that is taken.
    """
    out = last_value(overrides, "out")
    earlier = Path(out).expanduser() / CONFIG if out else None
    resumes = (last_value(overrides, "resume") or "").lower() == "true" and earlier and earlier.is_file()
    config = absolute(load_config(overrides, earlier if resumes else None))
    check_out(Path(config.out), config.resume)
    return config


def earlier_run(overrides: list[str]) -> Config:
    """The settings of the run in `out` (or `run`, which is the same), overrides on top.

    Raises:
        InputError: there is no run in `out`, or the settings cannot be.
    """
    overrides = ["out=" + text.removeprefix("run=") if text.startswith("run=") else text for text in overrides]
    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR, the folder of an earlier run")
    folder = Path(out).expanduser()
    if not (folder / CONFIG).is_file():
        raise InputError(f"{folder} holds no run ({CONFIG} is missing); give out=DIR of an earlier `room2dgs run`")
    return absolute(load_config(overrides, folder / CONFIG))


@contextmanager
def claimed(config: Config) -> Iterator[Path]:
    """The folder of a new or resumed run, with its config.yaml in it.

    Bad input that shows only now leaves things as they were: a new run without a checkpoint goes away
    again, a resumed one keeps its old config.yaml.

    Raises:
        InputError: the folder cannot be written.
    """
    out = Path(config.out)
    there = {path.name for path in out.iterdir()} if out.is_dir() else None
    before = (out / CONFIG).read_bytes() if (out / CONFIG).exists() else None
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_config(out, config)
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
    try:
        yield out
    except InputError:
        if before is not None:
            (out / CONFIG).write_bytes(before)
        elif not any((out / CHECKPOINTS).glob("*")):
            _clear(out, there)
        raise


def write_config(out: Path, config: Config) -> None:
    """config.yaml, whole or not at all."""
    with whole_file(out / CONFIG) as temporary:
        temporary.write_text(dump_config(replace(config, resume=False)), encoding="utf-8")


def keep_settings(out: Path, config: Config, section: str) -> None:
    """Takes one section over into the run's config.yaml: what it says made the files beside it."""
    saved = load_config((), out / CONFIG)
    write_config(out, replace(saved, **{section: getattr(config, section)}))


def absolute(config: Config) -> Config:
    """Paths that stay right when a later command starts elsewhere."""
    for key in path_keys():
        *parents, name = key.split(".")
        node = reduce(getattr, parents, config)
        if getattr(node, name):
            setattr(node, name, str(Path(getattr(node, name)).expanduser().absolute()))
    return config


def last_value(overrides: list[str], key: str) -> str | None:
    """What the last of the overrides gives a path key, without quotes around it; None if none does."""
    value = next((text.partition("=")[2] for text in reversed(overrides) if text.startswith(key + "=")), None)
    quoted = value and len(value) > 1 and value[0] in "'\"" and value[-1] == value[0]
    return value[1:-1] if quoted else value


def required(path: Path, verb: str) -> Path:
    """The path, or an InputError that names the command which makes it."""
    if not path.is_file():
        raise InputError(f"{path} is missing; make it with `room2dgs {verb} out={path.parent}`")
    return path


def check_out(out: Path, resume: bool) -> None:
    """Refuse a folder that another run or something else lies in."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; choose another out=DIR")
    if not out.exists():
        return
    if (out / CONFIG).exists():
        if resume:
            return
        raise InputError(f"{out} holds another run; add resume=true to go on with it, or choose another out=DIR")
    if any(path.name != CAPTURE for path in out.iterdir()):
        raise InputError(f"{out} is not empty and is not a run's folder; choose another out=DIR")


def _clear(out: Path, there: set[str] | None) -> None:
    """Without what a run that came to nothing has made; `there` was in the folder before, None: it was not there."""
    keep = {CAPTURE} | (there or set())
    for path in out.iterdir():
        if path.name in keep:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
    if there is None and not any(out.iterdir()):
        out.rmdir()
