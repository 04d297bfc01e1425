"""A run's folder: made once, never by accident over another's, cleared again when nothing came of it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from room2dgs.blame import by_the_machine
from room2dgs.config import Config, dump_config, load_config
from room2dgs.config.keys import path_keys
from room2dgs.config.overrides import unquoted
from room2dgs.errors import InputError
from room2dgs.files import is_temporary, remove_all_leftovers, remove_leftovers, whole_file
from room2dgs.links_out import refuse_links_out
from room2dgs.logs import LOG_FILE
from room2dgs.owner import LOCK, FolderGone, owned, refuse_if_owned
from room2dgs.runs.replacing import refuse_unfinished

CONFIG, MESH, METRICS = "config.yaml", "mesh.ply", "metrics.json"
TEXTURED, BOUNDARY, MIRRORS = "mesh.glb", "boundary.ply", "mirrors.json"
SURFELS, CHECKPOINTS, POINTS, RENDERS = "surfels.safetensors", "checkpoints", "points", "renders"
PRIORS, PRIOR_MAPS, CACHE, POSES = "priors.csv", "priors", "cache", "poses.json"
REPORT, TRUST, EXPORTS = "report.html", "trust.npz", "export"
EVAL, QUALITY = "eval", "quality.png"  # in the folder before it
KEPT = "kept"  # priors, until the run ends
CAPTURE = "capture"  # what `run video=...` made of the video, before the run itself
# What a run may have made before anything is finished; nothing else in its folder is ever removed.
MADE = {
    *(KEPT, CONFIG, METRICS, CHECKPOINTS, POINTS, PRIORS, PRIOR_MAPS, CACHE, POSES, TRUST, LOG_FILE, "tensorboard"),
    *("depth", "normal", "error", "num_consistent", "filled", "filled_confidence", "dense.ply", "coverage.json"),
}

# Where a file of these names, or a folder, cannot be written
FILES = (
    *(CONFIG, MESH, TEXTURED, BOUNDARY, MIRRORS, METRICS, SURFELS, PRIORS, POSES, REPORT, TRUST, LOG_FILE),
    *("dense.ply", "coverage.json"),
)
FOLDERS = (KEPT, CHECKPOINTS, POINTS, RENDERS, PRIOR_MAPS, CACHE, EXPORTS, CAPTURE, EVAL, "tensorboard")


def new_run(overrides: list[str]) -> Config:
    """The settings of `run` and `train`; with resume=true those of the run in `out`, overrides on top.

    Raises:
        InputError: settings that cannot be, or an `out` that is taken.
    """
    out, resume = last_value(overrides, "out"), wants_to_resume(overrides)
    earlier = Path(out).expanduser() / CONFIG if out else None
    if resume and earlier and not earlier.is_file() and not last_value(overrides, "scene.path"):
        raise InputError(
            f"{earlier.parent} holds no run to go on with ({CONFIG} is missing); to start one add scene.path=DIR"
        )
    if resume and earlier and earlier.is_file():
        refuse_unfinished(earlier.parent)
        config = saved_settings(earlier.parent, overrides)
    else:
        config = absolute(load_config(overrides))
    check_out(Path(config.out), config.resume)
    refuse_if_owned(Path(config.out))
    return config


def wants_to_resume(overrides: list[str]) -> bool:
    """Whether the last `resume=` is one of the words for true that settings take.

    Raises:
        InputError: it is neither true nor false.
    """
    given = last_value(overrides, "resume")
    if given is None:
        return False
    try:
        return TypeAdapter(bool).validate_python(given.strip())
    except ValidationError:
        raise InputError(f"resume={given} is neither true nor false; give resume=true or leave it out") from None


def earlier_run(overrides: list[str], unfinished_too: bool = False) -> Config:
    """The settings of the run in `out` (or `run`, which is the same), overrides on top.

    Args:
        unfinished_too: a run whose files are being replaced, which was stopped, will do.

    Raises:
        InputError: there is no run in `out`, its files are of two scales, or the settings cannot be.
    """
    overrides = ["out=" + text.removeprefix("run=") if text.startswith("run=") else text for text in overrides]
    out = last_value(overrides, "out")
    if not out:
        raise InputError("out is not given; add out=DIR, the folder of an earlier run")
    folder = Path(out).expanduser()
    if not (folder / CONFIG).is_file():
        raise InputError(f"{folder} holds no run ({CONFIG} is missing); give out=DIR of an earlier `room2dgs run`")
    if not unfinished_too:
        refuse_unfinished(folder)
    return saved_settings(folder, overrides)


def saved_settings(folder: Path, overrides: Sequence[str] = ()) -> Config:
    """The settings of the run in a folder, overrides on top, all paths absolute.

    What lay in the folder when they were saved, such as the capture of a video, lies in it wherever the folder was
    moved to.

    Raises:
        InputError: the settings cannot be.
    """
    config = absolute(load_config(overrides, folder / CONFIG))
    saved = absolute(load_config((), folder / CONFIG))
    before, now = Path(saved.out), folder.expanduser().absolute()
    for key in path_keys():
        value = value_at(saved, key)
        if key == "out" or value is None or value_at(config, key) != value or not Path(value).is_relative_to(before):
            continue
        moved = now / Path(value).relative_to(before)
        if moved.exists() or not Path(value).exists():
            _set(config, key, str(moved))
    return config


@contextmanager
def claimed(config: Config) -> Iterator[Path]:
    """The folder of a new or resumed run, with its config.yaml in it, and nobody else's meanwhile.

    Bad input that shows only now leaves things as they were: a new run without a checkpoint goes away again, a resumed
    one keeps its old config.yaml. What the machine fails of, such as a full disk, leaves what is finished, to go on.

    Raises:
        InputError: the folder cannot be written, or another process works there.
    """
    out = Path(config.out)
    _refuse_other_kinds(out)
    with owned(out):
        check_out(out, config.resume)  # again: somebody may have been faster
        remove_all_leftovers(out)
        there = {path.name for path in out.iterdir()}
        before = (out / CONFIG).read_bytes() if (out / CONFIG).exists() else None
        try:
            write_config(out, config)
        except OSError as error:
            raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
        try:
            yield out
            shutil.rmtree(out / KEPT, ignore_errors=True)
        except InputError as error:
            if by_the_machine(error) or isinstance(error, FolderGone):
                raise
            if before is not None:
                with whole_file(out / CONFIG) as temporary:
                    temporary.write_bytes(before)
            elif not (out / MESH).exists() and not any((out / CHECKPOINTS).glob("*")):
                _clear(out, there)
            raise


@contextmanager
def at_work(config: Config) -> Iterator[Path]:
    """The folder of an earlier run for a command that writes into it, and nobody else's meanwhile.

    Raises:
        InputError: the folder cannot be written, or another process works there.
    """
    out = Path(config.out)
    _refuse_other_kinds(out)
    with owned(out):
        remove_all_leftovers(out)
        yield out


@contextmanager
def at_work_beside(config: Config, out: Path) -> Iterator[None]:
    """The folder of an earlier run, which is read, and `out`, in it or elsewhere, which is written to.

    Raises:
        InputError: `out` cannot be written, or another process works in one of them.
    """
    run = Path(config.out)
    inside = out.is_relative_to(run)
    if inside:
        _refuse_other_kinds(run)
    with owned(run, writes=inside), nullcontext() if inside else owned(out):
        remove_leftovers(out, owned=True)
        yield


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
        if value := value_at(config, key):
            _set(config, key, str(Path(value).expanduser().absolute()))
    return config


def value_at(config: Config, key: str) -> Any:
    """Of a setting, by its dotted key."""
    return reduce(getattr, key.split("."), config)


def last_value(overrides: list[str], key: str) -> str | None:
    """What the last of the overrides gives a path key, without quotes around it; None if none does."""
    value = next((text.partition("=")[2] for text in reversed(overrides) if text.startswith(key + "=")), None)
    return value and unquoted(value)


def required(path: Path, verb: str) -> Path:
    """The path, or an InputError that names the command which makes it of what the run's folder holds."""
    if not path.is_file():
        resume = " resume=true" if verb in ("run", "train") and (path.parent / CONFIG).is_file() else ""
        raise InputError(f"{path} is missing; make it with `room2dgs {verb} out={path.parent}{resume}`")
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
    if any(path.name not in (CAPTURE, LOCK) and not is_temporary(path.name) for path in out.iterdir()):
        raise InputError(f"{out} is not empty and is not a run's folder; choose another out=DIR")


def _refuse_other_kinds(out: Path) -> None:
    """Before any work: what lies in a run's folder is of the kind that its name says, and leads nowhere else."""
    refuse_links_out(out)
    for names, other, kind, belongs in (
        (FILES, Path.is_dir, "folder", "file"),
        (FOLDERS, Path.is_file, "file", "folder"),
    ):
        for path in (out / name for name in names):
            if other(path):
                raise InputError(f"{path} is a {kind} where a {belongs} belongs; delete it, or give it another name")


def _clear(out: Path, there: set[str]) -> None:
    """Without what a run that came to nothing has made; `there` was in the folder before."""
    for name in sorted(MADE - there):
        path = out / name
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _set(config: Config, key: str, value: str) -> None:
    *parents, name = key.split(".")
    setattr(reduce(getattr, parents, config), name, value)
