"""From a folder to a `Scene`, whatever its layout."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from room2dgs.captures.cache import Cache
from room2dgs.captures.image_files import check_photo
from room2dgs.captures.readers.scannet import read_scannet
from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import SceneConfig

READERS: dict[str, Callable[[SceneConfig], Scene]] = {"scannet": read_scannet}


def read_scene(config: SceneConfig, cache: Cache | None = None) -> Scene:
    """Read a capture with the reader of its layout.

    Every file that a run will use is decoded once here, so that a broken one stops the run at its start.

    Args:
        cache: takes the decoded photos, as many as it has room for; the others are decoded again when they are used
            first. None: photos are read to their end and not kept.

    Returns:
        A scene with at least 3 training views; frames on disk that cannot be used are in `dropped`.

    Raises:
        InputError: missing or broken files, poses that are not rigid, sizes that disagree with the
            intrinsics, too few views; the sentence names the file.
    """
    scene = READERS[config.layout](config)
    if cache is not None:
        kept = [tuple(replace(frame, cache=cache) for frame in frames) for frames in (scene.train, scene.test)]
        scene = replace(scene, train=kept[0], test=kept[1], cache=cache)
    with ThreadPoolExecutor() as pool:
        list(pool.map(_checked, scene.frames))
    return scene


def _checked(frame: Frame) -> None:
    if frame.cache is not None and frame.cache.has_room(3 * frame.camera.width * frame.camera.height):
        frame.color()
    else:
        check_photo(frame.color_path)
