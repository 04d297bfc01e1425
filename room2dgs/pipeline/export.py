"""A run in the files of other programs."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.points import points_cache, points_may_lack
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.pipeline.surfels import load_run_surfels, render_frames, surfels_path, use_threads
from room2dgs.registries.exporters import EXPORTERS, Write, needs_of, place_of
from room2dgs.registry import Entry
from room2dgs.runs.folder import EXPORTS, MESH, at_work_beside, required
from room2dgs.runs.metrics import origin_of_run

if TYPE_CHECKING:
    from room2dgs.export.source import Source
    from room2dgs.primitives.primitive import Splats

NEEDS: dict[str, Callable[[Path], Path]] = {
    "surfels": surfels_path,
    "mesh": lambda out: required(out / MESH, "mesh"),
}


def export_run(config: Config, names: Sequence[str], out: Path | None = None, log: Log = to_terminal) -> list[Path]:
    """Writes the run in config.out in the formats of these names.

    Args:
        names: of `EXPORTERS`, or "all".
        out: the folder for them; None: the run's own folder of exports.

    Returns:
        The files.

    Raises:
        InputError: an unknown format, one that needs what the run has not, or a folder that cannot be written.
    """
    formats = chosen_formats(names)
    _check_needs(Path(config.out), formats)
    out = (out or Path(config.out) / EXPORTS).expanduser().absolute()
    _check_place(out, formats, config)
    use_threads(config)
    with at_work_beside(config, out):
        return write_formats(source_of(config, log), formats, out, log)


def export_after_run(scene: Scene, surfels: Splats, config: Config, run: RunFolder) -> None:
    """What export.after_run asks for, into the run's folder.

    Raises:
        InputError: as `write_formats`.
    """
    if not config.export.after_run:
        return
    source = source_of(config, run.log)
    source.scene, source.surfels = scene, surfels
    with run.timed("export"):
        write_formats(source, chosen_formats(config.export.after_run), run.path / EXPORTS, run.log)
    run.record()


def chosen_formats(names: Sequence[str]) -> list[Entry[Write]]:
    """The formats of these names, each once; "all" alone stands for all of them.

    Raises:
        InputError: no name, or one that no format has.
    """
    known = ", ".join(EXPORTERS)
    if not names:
        raise InputError(f"to is not given; choose one or more from {known}, all")
    if list(names) == ["all"]:
        return list(EXPORTERS.entries())
    unknown = next((name for name in names if name not in EXPORTERS), None)
    if unknown is not None:
        raise InputError(f"to={','.join(names)} is not known: {unknown!r}; choose one or more from {known}, all")
    return [EXPORTERS.get(name) for name in dict.fromkeys(names)]


def write_formats(source: Source, formats: Iterable[Entry[Write]], out: Path, log: Log) -> list[Path]:
    """Each format to its place in `out`, with a line of its size and time.

    Returns:
        The files.

    Raises:
        InputError: the folder cannot be written.
    """
    written: list[Path] = []
    for one in formats:
        start, worked = time.perf_counter(), time.process_time()
        write, place = one.load(), out / place_of(one)
        try:
            files = write(source, place)
        except OSError as error:
            raise InputError(f"{out} cannot be written ({error.strerror}); choose another out=DIR") from error
        written += files
        size = sum(path.stat().st_size for path in files) / 1e6
        many = f", {len(files)} files" if len(files) > 1 else ""
        seconds, worked = time.perf_counter() - start, time.process_time() - worked
        log(f"{one.name:<12} {place}  {size:.2f} MB{many}, {seconds:.1f} s (processor {worked:.1f} s)")
    return written


def source_of(config: Config, log: Log) -> Source:
    """What the run in config.out gives, each part read when it is first asked for."""
    from room2dgs.export.source import Source
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.sfm.sparse import sparse_points

    out = Path(config.out)
    return Source(
        out,
        config,
        read_scene=lambda: scene_of_run(config),
        read_surfels=lambda: load_run_surfels(out),
        read_mesh=lambda origin_m: read_in_scene(required(out / MESH, "mesh"), origin_m),
        read_points=lambda scene: sparse_points(
            scene, config.points, points_cache(config, out), log, may_lack=points_may_lack(config)
        ),
        render=lambda surfels, frames: render_frames(surfels, frames, config),
        log=log,
        recorded_origin_m=origin_of_run(out),
    )


def _check_needs(run: Path, formats: Sequence[Entry[Write]]) -> None:
    """Reported before anything is written."""
    for one in formats:
        for need in needs_of(one):
            if need in NEEDS:
                NEEDS[need](run)
            elif importlib.util.find_spec(need) is None:
                raise InputError(f"to={one.name} needs {need}; install it with pip install 'room2dgs[export]'")


def _check_place(out: Path, formats: Iterable[Entry[Write]], config: Config) -> None:
    """Refuse to write over the run's own files or the capture's."""
    run, scene = Path(config.out).absolute(), Path(config.scene.path).absolute()
    if out == run:
        raise InputError(
            f"out={out} is the run's own folder, whose files would be lost; leave out= away, or name another"
        )
    for target in (out, *(out / place_of(one) for one in formats)):
        if target == scene or (target != out and target in scene.parents):
            raise InputError(f"{target} has the capture, whose files would be lost; choose another out=DIR")
