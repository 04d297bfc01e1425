"""Links that lead out of a capture: they are followed and reported once."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path

from room2dgs.captures.capture import Capture, Shot
from room2dgs.captures.photos import PhotoFile
from room2dgs.texts import shown_name


def links_out(capture: Capture, shots: Sequence[Shot]) -> str | None:
    """A note on the capture's files that lie elsewhere; None: there are none."""
    root = capture.root if capture.root.is_dir() else capture.root.parent
    real_root = os.path.realpath(root)
    real_folder = lru_cache(maxsize=None)(os.path.realpath)

    def outside(path: Path) -> Path | None:
        """Where a path within the capture leads to, if that is out of it."""
        text = os.fspath(path)
        if not _within(os.path.normpath(text), os.path.normpath(root)):
            return None  # no link: the layout has it there
        folder, name = os.path.split(text)
        real = os.path.join(real_folder(folder), name)
        if os.path.islink(real):
            real = os.path.realpath(real)
        return None if _within(real, real_root) else Path(real)

    found: dict[str, dict[Path, Path]] = {}
    for what, path in _files(root, shots):
        real = outside(path)
        if real is not None:
            found.setdefault(what, {})[path] = real
    if not found:
        return None
    counts = ", ".join(f"{len(paths)} {what}" for what, paths in found.items())
    path, real = next(iter(next(iter(found.values())).items()))
    return f"links: {counts} lie outside of the capture, the first ({shown_name(path.name)}) at {shown_name(real)}"


def _files(root: Path, shots: Sequence[Shot]) -> Iterator[tuple[str, Path]]:
    for shot in shots:
        if shot.photo is None:
            yield "photos", shot.path
        if shot.depth is not None:
            yield "depth maps", shot.depth if isinstance(shot.depth, Path) else Path(shot.depth.label)
        if isinstance(shot.mask, PhotoFile):
            yield "masks", shot.mask.path
        if isinstance(shot.pose, partial) and shot.pose.args and isinstance(shot.pose.args[0], Path):
            yield "poses", shot.pose.args[0]
    try:
        with os.scandir(root) as entries:
            yield from (("other files", Path(one.path)) for one in entries if one.is_symlink() and one.is_file())
    except OSError:
        return


def _within(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder.rstrip(os.sep) + os.sep)
