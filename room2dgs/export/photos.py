"""A capture's photos as its cameras see them: without distortion, at the size that the run worked with."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

import cv2

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
