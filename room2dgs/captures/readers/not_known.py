"""The error for a path that is no capture: what it is instead, and where the nearest capture is."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from room2dgs.captures.listing import PHOTO_SUFFIXES, VIDEO_SUFFIXES, Listing, listed, natural, unread_photos
from room2dgs.captures.readers.other_programs import poses_of_others
from room2dgs.errors import InputError
from room2dgs.regular_files import how, not_regular, open_regular, refusal, written_otherwise

PHOTO_FOLDERS = ("images", "rgb", "color")
PACKED = (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".rar", ".zst")
FILES = {
    PHOTO_SUFFIXES: "is a photo and poses are unknown",
    VIDEO_SUFFIXES: "is a video and poses are unknown",
    PACKED: "is an archive of no layout that is read in place",
}
MOST_FOLDERS = 300  # that are looked into for captures
MOST_NAMES = 10_000
BELOW, ABOVE = 3, 2  # how far captures are looked for
NAMED = 3
HEAD_BYTES = 1 << 16  # by which a transforms.json of another name is told
MEND = "give scene.path=DIR of a capture (docs/reference/captures.md lists the layouts)"

LayoutOf = Callable[[Listing], str | None]


def check_there(root: Path) -> None:
    """Refuse a path that leads to no folder or file.

    Raises:
        InputError: nothing is there, or only a name in other letters, a link to nothing, a pipe or a device.
    """
    try:
        mode = os.stat(root).st_mode
    except FileNotFoundError as error:
        raise _missing(root, error) from error
    except (OSError, ValueError) as error:
        raise refusal(root, error, MEND) from error
    kind = not_regular(mode)
    if kind and not root.is_dir():
        raise InputError(f"{root} is {kind} where a capture belongs; {MEND}")


def _missing(root: Path, error: OSError) -> InputError:
    if os.path.islink(root):
        return refusal(root, error, MEND)
    first = root
    while first.parent != first and not first.parent.exists():
        first = first.parent
    alike = written_otherwise(first)
    if alike:
        there = Path(os.path.normpath(first.parent / alike / root.relative_to(first)))
        return InputError(f"{root} is not there; {there} {how(first.name, alike)}: give scene.path={there}")
    return InputError(f"{root} is not there; {MEND}")


def not_known(files: Listing, layout_of: LayoutOf, example: str) -> InputError:
    """The sentence for a path that is in no layout.

    Args:
        layout_of: the layout of a folder or file, None: it has none.
        example: what is on disk in one of the layouts.
    """
    root = files.root
    near = _captures_below(root, layout_of) or _capture_above(root, layout_of)
    what = _what(files)
    if near:
        return InputError(f"{root} {what or 'is in no layout that is known'}; {near}")
    if what and root.suffix.lower() in PACKED and root.is_file():
        return InputError(f"{root} {what}; unpack it and give scene.path=DIR of what was in it")
    videos = files.with_suffix(VIDEO_SUFFIXES)
    if videos:
        return InputError(
            f"{root if root.is_file() else root / videos[0]} is a video and poses are unknown: `room2dgs prepare "
            "video=FILE out=DIR` finds them, `room2dgs run video=FILE out=DIR` goes on to the mesh"
        )
    others = poses_of_others(files)
    if others:
        return InputError(f"{root} {others}; or `room2dgs prepare images=DIR out=DIR` finds poses anew")
    if what and "poses are unknown" in what:
        return InputError(
            f"{root} {what}: `room2dgs prepare images=DIR out=DIR` finds them, `room2dgs run images=DIR out=DIR` goes "
            "on to the mesh"
        )
    unknown = f"is in no layout that is known; docs/reference/captures.md lists them, one of them is {example}"
    return InputError(f"{root} {what}; {MEND}" if what else f"{root} {unknown}")


def _what(files: Listing) -> str | None:
    """What there is, with its verb."""
    root = files.root
    if root.is_file():
        kinds = (suffix for suffix in FILES if root.suffix.lower() in suffix)
        return FILES.get(next(kinds, ()), "is a file that is no capture")
    if not listed(root):
        return "is empty"
    photos = files.with_suffix(PHOTO_SUFFIXES) or any(
        name.lower().endswith(PHOTO_SUFFIXES) for folder in PHOTO_FOLDERS for name in listed(root / folder)
    )
    if photos:
        return "has photos and poses are unknown"
    packed = files.with_suffix(PACKED)
    if packed:
        return f"has {packed[0]}, an archive of no layout that is read in place: unpack it there"
    unread = unread_photos(root)
    return f"is in no layout that is known, and of its files {unread.partition(';')[0]}" if unread else None


def _captures_below(root: Path, layout_of: LayoutOf) -> str | None:
    """Which folders or files in it are captures, in words."""
    if not root.is_dir():
        return None
    level, looked = [root], 0
    for _ in range(BELOW):
        inner = [folder / name for folder in level for name in natural(_listed(folder))][:MOST_NAMES]
        inner = sorted(inner, key=lambda path: not path.is_dir())[: MOST_FOLDERS - looked]
        looked += len(inner)
        found = [(path, layout) for path in inner if (layout := _layout(path, layout_of))]
        if len(found) == 1:
            return f"scene.path={found[0][0]} is a capture ({found[0][1]})"
        if found:
            names = ", ".join(str(path.relative_to(root)) for path, _ in found[:NAMED])
            more = f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
            return f"{len(found)} captures are in it ({names}{more}): give scene.path={found[0][0]} or another of them"
        level = [path for path in inner if path.is_dir()]
    return None


def _capture_above(root: Path, layout_of: LayoutOf) -> str | None:
    for folder in list(Path(os.path.abspath(root)).parents)[:ABOVE]:
        layout = _layout(folder, layout_of) if folder.parent != folder else None
        if layout:
            return f"it belongs to a capture: give scene.path={folder} ({layout})"
    return None


def _layout(path: Path, layout_of: LayoutOf) -> str | None:
    try:
        if path.suffix.lower() == ".json" and path.is_file() and not _has_frames(path):
            return None  # which is in a layout only if somebody says so
        return layout_of(Listing(path)) if path.is_dir() or path.is_file() else None
    except (InputError, OSError):
        return None


def _has_frames(path: Path) -> bool:
    with open_regular(path) as file:
        return b'"frames"' in file.read(HEAD_BYTES)


def _listed(folder: Path) -> frozenset[str]:
    try:
        return listed(folder)
    except InputError:
        return frozenset()
