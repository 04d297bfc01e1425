"""From a folder to a `Scene`, whatever its layout."""

from __future__ import annotations

from collections.abc import Callable

from room2dgs.captures.readers.scannet import read_scannet
from room2dgs.captures.scene import Scene
from room2dgs.config import SceneConfig

READERS: dict[str, Callable[[SceneConfig], Scene]] = {"scannet": read_scannet}


def read_scene(config: SceneConfig) -> Scene:
    """Read a capture with the reader of its layout.

    Every file that a run will use is decoded once here, so that a broken one stops the run at its start.

    Returns:
        A scene with at least 3 training views; frames on disk that cannot be used are in `dropped`.

    Raises:
        InputError: missing or broken files, poses that are not rigid, sizes that disagree with the
            intrinsics, too few views; the sentence names the file.
    """
    return READERS[config.layout](config)
