"""What was dropped or named: a capture with poses, photos without, or a video; and where uploads may lie."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from room2dgs.captures.listing import PHOTO_SUFFIXES, VIDEO_SUFFIXES, Listing
from room2dgs.captures.readers.choice import reader_of
from room2dgs.config import load_config
from room2dgs.errors import InputError

LEAST_PHOTOS = 3
LONGEST = 120  # characters of a part of a path
DEEPEST = 6  # parts of an upload's path
NAME = re.compile(r"[\w][\w .,()+@#-]*")


def source_settings(path: Path) -> list[str]:
    """The setting by which a run takes a path: "scene.path=...", "images=..." or "video=...", quoted as needed.

    Raises:
        InputError: nothing is there, or nothing that a run reads.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist; give a folder or a video on this machine")
    if path.is_file() and path.suffix.lower() in VIDEO_SUFFIXES:
        return [f"prepare.video={quoted(path)}"]
    setting = f"scene.path={quoted(path)}"
    try:
        reader_of(load_config([setting, "out=unused"]).scene, Listing(path))
    except InputError:
        photos = [one for one in path.glob("*") if one.suffix.lower() in PHOTO_SUFFIXES] if path.is_dir() else []
        if len(photos) < LEAST_PHOTOS:
            raise
        return [f"prepare.images={quoted(path)}"]
    return [setting]


def quoted(path: Path) -> str:
    """A path as an override's value, whatever its name."""
    text = str(path).replace("\\", "\\\\").replace("'", "\\'")
    return f"'{text}'"


def uploaded(folder: Path, name: str) -> Path:
    """Where an uploaded file belongs.

    Args:
        folder: of the upload.
        name: relative path as the browser has it, with "/" between its parts.

    Raises:
        InputError: it would lie elsewhere, or no file may be called so.
    """
    parts = PurePosixPath(name).parts
    fits = 1 <= len(parts) <= DEEPEST and not name.startswith("/") and name == "/".join(parts)
    if not fits or not all(len(part) <= LONGEST and NAME.fullmatch(part) for part in parts):
        raise InputError(f"a file cannot be uploaded as {name!r}; give it a plain name")
    return folder.joinpath(*parts)


def capture_in(folder: Path) -> Path:
    """What an upload is of: its only file or folder, else the whole of it.

    Raises:
        InputError: it is empty.
    """
    found = sorted(folder.iterdir()) if folder.is_dir() else []
    if not found:
        raise InputError("nothing was uploaded; drop a folder with photos, or a video")
    return found[0] if len(found) == 1 else folder


def free_name(out: Path, wanted: str) -> str:
    """A name for a run's folder that is not taken, after the capture's."""
    plain = re.sub(r"[^\w.-]+", "_", wanted).strip("._")[:LONGEST] or "room"
    plain = f"{plain}_run" if plain == "captures" else plain
    names = (plain, *(f"{plain}_{number}" for number in range(2, 10_000)))
    return next(name for name in names if not (out / name).exists())
