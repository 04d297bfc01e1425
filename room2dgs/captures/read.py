"""From a folder or file to a `Scene`, whatever its layout."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from room2dgs.captures.assemble import assembled
from room2dgs.captures.cache import Cache
from room2dgs.captures.checked import checked
from room2dgs.captures.listing import Listing
from room2dgs.captures.passed_over import warn_passed_over
from room2dgs.captures.readers.choice import reader_of
from room2dgs.captures.readers.not_known import check_there
from room2dgs.captures.scene import Scene
from room2dgs.captures.unmatched import warn_unmatched
from room2dgs.config import SceneConfig, load_config
from room2dgs.errors import InputError


def read_scene(config: SceneConfig | str | os.PathLike[str], cache: Cache | None = None) -> Scene:
    """Read a capture with the reader of its layout.

    Every file that a run will use is decoded once here: a broken one is left out, more of them stop the run at its
    start.

    Args:
        config: the settings; or the path of the capture alone, which is read with the default settings.
        cache: takes the decoded photos, as many as it has room for; the others are decoded again when they are used
            first. None: photos are read to their end and not kept.

    Returns:
        A scene with at least 3 training views; frames on disk that cannot be used are in `dropped`.

    Raises:
        InputError: many missing or broken files or poses that are not rigid, sizes that disagree with the
            intrinsics, masks that hide everything, too few views; the sentence names the file.
    """
    scene = placed(_settings(config))
    if cache is not None:
        kept = [tuple(replace(frame, cache=cache) for frame in frames) for frames in (scene.train, scene.test)]
        scene = replace(scene, train=kept[0], test=kept[1], cache=cache)
    return checked(scene)


def placed(config: SceneConfig) -> Scene:
    """The same without a look into the photos: their sizes and poses.

    Raises:
        InputError: as `read_scene`, but for photos that cannot be decoded.
    """
    root = Path(config.path)
    check_there(root)
    capture = reader_of(config, Listing(root)).load().read(root, config)
    warn_unmatched(capture)
    warn_passed_over(capture)
    return assembled(capture, config)


def _settings(config: SceneConfig | str | os.PathLike[str]) -> SceneConfig:
    """The settings, or the default ones of a path.

    Raises:
        InputError: it is neither settings nor a path.
    """
    if isinstance(config, SceneConfig):
        return config
    if not isinstance(config, str | os.PathLike):
        raise InputError(
            f"a {type(config).__name__} is no capture; give its path, or settings such as load_config([...]).scene"
        )
    return load_config([f"scene.path={os.fspath(config)}", "out=unused"]).scene
