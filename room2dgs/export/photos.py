"""A capture's photos and masks as its cameras see them: without distortion, at the size that the run worked with."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.scene import Frame
from room2dgs.files import whole_file

JPEG = [cv2.IMWRITE_JPEG_QUALITY, 97]
COPIED = (".jpg", ".jpeg", ".png")


def write_photos(frames: Iterable[Frame], folder: Path) -> dict[str, str]:
    """The photos; a file that is just what the camera sees is copied, others become JPEG.

    Returns:
        Frame's name -> its photo's name in the folder.
    """
    names = {}
    for frame in frames:
        source = frame.source
        suffix = source.path.suffix.lower() if isinstance(source, PhotoFile) else ""
        as_is = suffix in COPIED and frame.lens is None and source.size() == frame.camera.size
        name = f"{frame.name}{suffix if as_is else '.jpg'}"
        with whole_file(folder / name) as temporary:
            if as_is and isinstance(source, PhotoFile):
                shutil.copyfile(source.path, temporary)
            else:
                temporary.write_bytes(cv2.imencode(".jpg", frame.color()[..., ::-1], JPEG)[1].tobytes())
        names[frame.name] = name
    return names


def write_masks(frames: Iterable[Frame], folder: Path, names: Mapping[str, str]) -> dict[str, str]:
    """What of the photos may be used, white; of those of which not everything may. Called PHOTO.png, as COLMAP does.

    Args:
        names: of `write_photos`.

    Returns:
        Frame's name -> its mask's name in the folder.
    """
    masks = {}
    for frame in frames:
        usable = frame.mask()
        if usable is None:
            continue
        masks[frame.name] = f"{names[frame.name]}.png"
        with whole_file(folder / masks[frame.name]) as temporary:
            temporary.write_bytes(cv2.imencode(".png", usable.astype(np.uint8) * 255)[1].tobytes())
    return masks
