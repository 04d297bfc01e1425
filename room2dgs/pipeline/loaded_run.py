"""An earlier run, loaded for a step that is done again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.logs import Log
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.pipeline.surfels import load_run_surfels
from room2dgs.runs.folder import at_work

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats


@contextmanager
def loaded_run(config: Config, show: Log | None = None) -> Iterator[tuple[Scene, Splats | None, RunFolder]]:
    """The run in config.out: its capture with the run's poses, its surfels (None if it trains nothing), its folder.

    No other process writes to the folder while the block runs.

    Args:
        show: takes the lines of the log one at a time; None: they go to the standard output.

    Raises:
        InputError: the run is not trained to the end, the capture is gone, or another process works in the folder.
    """
    with at_work(config) as out:
        surfels = load_run_surfels(out) if config.mesh.of_surfels else None
        yield scene_of_run(config), surfels, RunFolder.with_log(out, show=show)


@contextmanager
def loaded_surfels(config: Config, show: Log | None = None) -> Iterator[tuple[Scene, Splats, RunFolder]]:
    """As `loaded_run`, for steps that nothing but surfels will do.

    Raises:
        InputError: as there, or the run trains nothing.
    """
    with at_work(config) as out:
        surfels = load_run_surfels(out)
        yield scene_of_run(config), surfels, RunFolder.with_log(out, show=show)
