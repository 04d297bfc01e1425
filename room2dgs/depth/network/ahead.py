"""A network's maps made while something else that needs no maps is at work."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event

from room2dgs.captures.scene import Frame
from room2dgs.config import ONE_PHOTO_SOURCES, PriorConfig
from room2dgs.depth.network.maps import predicted_maps, read_models
from room2dgs.logs import Log


@contextmanager
def maps_ahead(frames: Sequence[Frame], config: PriorConfig, log: Log) -> Iterator[Callable[[], None]]:
    """Gives a function that begins to fill the map cache; the block's end begins it too, and waits for it.

    If the block fails it stops with the photo at hand.
    Only what `estimate_depth` will ask for whatever it finds: the depth of a network that sees one photo at a time,
    with normals if the same inference gives them, or the normals of the network that comes with the package. Others'
    normals are checked on a few photos first.

    Raises:
        InputError: as `predicted_maps`.
    """
    kind, settings = _wanted(frames, config)
    if kind is None:
        yield lambda: None
        return
    stop = Event()
    making: list[Future[dict[str, Path]]] = []

    def begin() -> None:
        if not making:
            making.append(pool.submit(predicted_maps, frames, kind, settings, read_models(settings), log, stop))

    with ThreadPoolExecutor(1) as pool:
        try:
            yield begin
            begin()
            making[0].result()
        finally:
            stop.set()


def _wanted(frames: Sequence[Frame], config: PriorConfig) -> tuple[str | None, PriorConfig]:
    """The kind to begin with, if any, and the settings with "auto" decided."""
    if config.depth.source == "auto" and not any(frame.depth_path for frame in frames):
        config = replace(config, depth=replace(config.depth, source="room_prior"))
    if config.depth.source in ONE_PHOTO_SOURCES:
        return "depth", config
    return ("normal" if config.normal.source == "room_prior" else None), config
