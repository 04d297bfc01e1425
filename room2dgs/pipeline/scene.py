"""Reading the capture of a run, and saying how it was understood."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.folder import CACHE, POSES


def read_capture(config: Config, keep_photos: bool = False) -> Scene:
    """The capture that the settings name, with the poses that it brings.

    Args:
        keep_photos: decoded, as far as memory.cache_mb allows: for steps that use all of them more than once.

    Raises:
        InputError: as `read_scene`.
    """
    from room2dgs.captures.cache import Cache
    from room2dgs.captures.read import read_scene

    return read_scene(config.scene, Cache(config.memory.cache_mb) if keep_photos else None)


def scene_of_run(config: Config) -> Scene:
    """The capture of an earlier run, with the poses that the run worked with.

    Raises:
        InputError: as `read_scene` and `read_poses`.
    """
    return with_poses_of_run(read_capture(config), Path(config.out))


def with_poses_of_run(scene: Scene, out: Path) -> Scene:
    """The capture with the poses and in the unit that the run in `out` worked with, if it has come to any.

    Raises:
        InputError: as `read_poses`.
    """
    from room2dgs.captures.in_metres import in_metres
    from room2dgs.captures.poses_file import read_poses, read_unit

    if not (out / POSES).exists():
        return scene
    unit = read_unit(out / POSES, scene)
    return read_poses(out / POSES, scene if unit is None else in_metres(scene, unit))[0]


@contextmanager
def photos_cached(scene: Scene, out: Path) -> Iterator[None]:
    """Photos that memory has no room for lie decoded in the run's folder, until the block ends."""
    scene.cache.use_folder(out / CACHE)
    try:
        yield
    finally:
        scene.cache.clear()


def describe_capture(scene: Scene, run: RunFolder) -> None:
    """How the capture was understood: to the log and to metrics.json."""
    for note in scene.notes:
        run.log(note)
    for warning in scene.warnings:
        run.log(f"WARNING: {warning}")
    for dropped in scene.dropped:
        run.log(f"frame {dropped.name} left out: {dropped.reason}")
    about = {
        "layout": scene.layout,
        "metric": scene.metric,
        "origin_m": list(scene.origin_m),
        "warnings": list(scene.warnings),
        "left_out": {dropped.name: dropped.reason for dropped in scene.dropped},
    }
    run.record({"capture": about})
