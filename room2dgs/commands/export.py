"""`room2dgs export`: an earlier run in the files of other programs."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.commands.settings_help import asked_for_help, settings
from room2dgs.commands.stages import (
    points_may_lack,
    read,
    rendered,
    surfels_of_run,
    trained_surfels,
    use_threads,
    with_poses_of_run,
)
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log, to_terminal
from room2dgs.runs.folder import EXPORTS, MESH, POINTS, at_work_beside, earlier_run, last_value, required
from room2dgs.runs.metrics import origin_of_run, record, timed

if TYPE_CHECKING:
    from room2dgs.export.registry import Format
    from room2dgs.export.source import Source
    from room2dgs.splat.types import Surfels

USAGE = "room2dgs export run=DIR to=FORMAT[,FORMAT...] [out=DIR] [up=auto] [faces=N] [max_error_m=0.01] [KEY=VALUE ...]"
OURS = ("run", "to", "out")
SHORT = {"up": "export.up", "faces": "export.faces", "max_error_m": "export.max_error_m"}
NEEDS: dict[str, Callable[[Path], Path]] = {
    "surfels": surfels_of_run,
    "mesh": lambda out: required(out / MESH, "mesh"),
}


def main(argv: list[str]) -> int:
    """Write an earlier run's results for other programs, to RUN/export unless out= says otherwise.

    up= turns splats and meshes so that they stand upright there, faces= and max_error_m= simplify meshes; to=all
    writes everything.
    """
    if asked_for_help(argv):
        return _help()
    run, wanted = last_value(argv, "run"), last_value(argv, "to")
    if not run:
        raise InputError("run is not given; add run=DIR, the folder of an earlier run")
    overrides = [_written_out(text) for text in argv if text.partition("=")[0] not in OURS]
    config = earlier_run([*overrides, f"out={run}"])
    formats = chosen(wanted)
    _check(Path(config.out), formats)
    out = Path(last_value(argv, "out") or Path(config.out) / EXPORTS).expanduser().absolute()
    _check_place(out, formats, config)
    use_threads(config)
    with at_work_beside(config, out):
        write(source_of(config, to_terminal), formats, out, to_terminal)
    return 0


def chosen(wanted: str | None) -> list[Format]:
    """The formats that `to=` names, each once.

    Raises:
        InputError: none, or one that there is not.
    """
    from room2dgs.export.registry import FORMATS

    known = ", ".join(FORMATS)
    if not wanted:
        raise InputError(f"to is not given; choose one or more from {known}, all")
    names = list(FORMATS) if wanted == "all" else list(dict.fromkeys(wanted.strip("[]").split(",")))
    unknown = next((name for name in names if name not in FORMATS), None)
    if unknown is not None:
        raise InputError(f"to={wanted} is not known: {unknown!r}; choose one or more from {known}, all")
    return [FORMATS[name] for name in names]


def _check_place(out: Path, formats: Iterable[Format], config: Config) -> None:
    """Refuse to write over the run's own files or the capture's."""
    run, scene = Path(config.out).absolute(), Path(config.scene.path).absolute()
    if out == run:
        raise InputError(
            f"out={out} is the run's own folder, whose files would be lost; leave out= away, or name another"
        )
    for target in (out, *(out / one.place for one in formats)):
        if target == scene or (target != out and target in scene.parents):
            raise InputError(f"{target} has the capture, whose files would be lost; choose another out=DIR")


def write(source: Source, formats: Iterable[Format], out: Path, log: Log) -> None:
    """Each format to its place in `out`, with what it takes.

    Raises:
        InputError: the folder cannot be written.
    """
    for one in formats:
        start, worked = time.perf_counter(), time.process_time()
        try:
            files = one.write(source, out / one.place)
        except OSError as error:
            raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
        size = sum(path.stat().st_size for path in files) / 1e6
        many = f", {len(files)} files" if len(files) > 1 else ""
        seconds, worked = time.perf_counter() - start, time.process_time() - worked
        log(f"{one.name:<12} {out / one.place}  {size:.2f} MB{many}, {seconds:.1f} s (processor {worked:.1f} s)")


def export_after_run(scene: Scene, surfels: Surfels, config: Config, log: Log, seconds: dict[str, float]) -> None:
    """What export.after_run asks for, into the run's folder."""
    if not config.export.after_run:
        return
    from room2dgs.export.registry import FORMATS

    out = Path(config.out)
    source = source_of(config, log)
    source.scene, source.surfels = scene, surfels
    with timed(seconds, "export"):
        write(source, [FORMATS[name] for name in config.export.after_run], out / EXPORTS, log)
    record(out, {}, seconds)


def source_of(config: Config, log: Log) -> Source:
    """What the run in config.out gives, each part read when it is first asked for."""
    from room2dgs.export.source import Source
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.sfm.sparse import sparse_points

    out = Path(config.out)
    return Source(
        out,
        config,
        read_scene=lambda: with_poses_of_run(read(config), out),
        read_surfels=lambda: trained_surfels(out),
        read_mesh=lambda origin_m: read_in_scene(required(out / MESH, "mesh"), origin_m),
        read_points=lambda scene: sparse_points(
            scene, config.points, Path(config.points.cache or out / POINTS), log, may_lack=points_may_lack(config)
        ),
        render=lambda surfels, frames: rendered(surfels, frames, config),
        log=log,
        recorded_origin_m=origin_of_run(out),
    )


def _check(run: Path, formats: Sequence[Format]) -> None:
    """Reported before anything is written."""
    for one in formats:
        for need in one.needs:
            if need in NEEDS:
                NEEDS[need](run)
            elif importlib.util.find_spec(need) is None:
                raise InputError(f"to={one.name} needs {need}; install it with pip install 'room2dgs[export]'")


def _written_out(text: str) -> str:
    key, equals, value = text.partition("=")
    return f"{SHORT[key]}={value}" if equals and key in SHORT else text


def _help() -> int:
    from room2dgs.export.registry import FORMATS

    print(f"{USAGE}\n\n{main.__doc__}\n")
    for one in FORMATS.values():
        print(f"  {one.name:<12} {one.place:<16} {one.words}")
    print("\n".join(settings(("export",))))
    return 0
