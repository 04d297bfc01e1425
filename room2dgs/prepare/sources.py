"""Metric depth of placed photos from a sensor's files or the network that comes with room2dgs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import listed, natural
from room2dgs.captures.photo_names import shared_stems
from room2dgs.captures.scene import Frame
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.prepare.metres import DepthOf
from room2dgs.prepare.photos import ChosenPhoto

# Depth cameras of phones and of Kinects are trusted to here.
SENSOR_REACH_M = 4.0


def depth_files(folder: Path, photos: Sequence[ChosenPhoto]) -> dict[str, Path]:
    """Photo's name -> its depth map: of the same name, or with the number of the video's frame.

    Raises:
        InputError: there is none, one lies on its side, two are of one photo, or one is of two.
    """
    maps = [name for name in natural(listed(folder)) if name.lower().endswith((".png", ".npy"))]
    names = {Path(name).stem: folder / name for name in maps}
    twice = min(shared_stems(maps), default=None)
    if twice is not None:
        raise InputError(f"{folder} has two depth maps called {twice}; delete one of them")
    shared = min(shared_stems(photo.name for photo in photos) & names.keys(), default=None)
    if shared is not None:
        raise InputError(f"{names[shared]} could be of several photos called {shared}; rename them and their maps")
    numbered = _by_last_number(names)
    matched = ((photo, _depth_file_of(photo, names, numbered)) for photo in photos)
    found = {photo.name: path for photo, path in matched if path is not None}
    for photo in photos:
        if photo.name in found:
            _check_upright(found[photo.name], photo)
    if not found:
        raise InputError(
            f"{folder} has no depth map named as a photo, such as {Path(photos[0].name).stem}.png; rename them"
        )
    return found


def _by_last_number(paths: Mapping[str, Path]) -> dict[int, Path]:
    """Last number in a stem -> its path; of several stems the first by name."""
    found: dict[int, Path] = {}
    for stem, path in sorted(paths.items()):
        if parts := re.findall(r"\d+", stem):
            found.setdefault(int(parts[-1]), path)
    return found


def _depth_file_of(photo: ChosenPhoto, paths: Mapping[str, Path], numbered: Mapping[int, Path]) -> Path | None:
    """The map of a photo's stem; of a video's frame else the one with its number."""
    by_stem = paths.get(Path(photo.name).stem)
    return numbered.get(photo.index) if by_stem is None and photo.seconds is not None else by_stem


def _check_upright(path: Path, photo: ChosenPhoto) -> None:
    """Photos are turned upright as their files say; depth files say nothing."""
    height, width = depth_file(path).metres().shape
    if (width - height) * (photo.size[0] - photo.size[1]) < 0:
        raise InputError(
            f"{path} has {width}x{height} pixels, but its photo, turned upright, {photo.size[0]}x{photo.size[1]}; turn "
            "the depth maps likewise"
        )


def sensor_depths(files: dict[str, Path]) -> DepthOf:
    """Of frames whose photos have such files."""

    def depth_of(frame: Frame) -> tuple[np.ndarray, np.ndarray] | None:
        path = files.get(frame.color_path.name)
        if path is None:
            return None
        depth = depth_file(path, 1.0 if path.suffix == ".npy" else 0.001).seen_by(frame.camera, frame.lens)
        return depth, (depth > 0) & (depth < SENSOR_REACH_M)

    return depth_of


def network_depths(threads: int | None) -> DepthOf:
    """Of any frame. The network sees the photo and its focal length.

    Raises:
        InputError: the network did not come with this installation.
    """
    from room2dgs.depth.network.card import format_of
    from room2dgs.depth.network.maps import at_camera
    from room2dgs.depth.network.network import predicted
    from room2dgs.depth.network.session import open_network
    from room2dgs.depth.network.shipped import model_path

    settings = load_config(["scene.path=unused", "out=unused", "prior/depth=room_prior"]).prior.depth
    network = open_network(model_path(settings), "depth", format_of(settings, "depth"), threads, "cpu")

    def depth_of(frame: Frame) -> tuple[np.ndarray, np.ndarray] | None:
        found = at_camera(predicted(network, frame.color(), frame.camera), frame.camera)
        return found.values, found.valid & (found.values > 0)

    return depth_of
