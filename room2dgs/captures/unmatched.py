"""Warns of folders of depth maps and masks that match no photo, or only some."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator
from pathlib import Path

from room2dgs.captures.capture import Capture, Shot
from room2dgs.captures.left_out import some
from room2dgs.captures.listing import listed, natural

DEPTH, MASK = "depth map", "mask"
FOLDERS = {DEPTH: re.compile(r"(^|[_-])depths?([_-]|$)"), MASK: re.compile(r"(^|[_-])masks?([_-]|$)")}
FILES = {
    DEPTH: re.compile(r"(^|[^a-z])depths?([^a-z]|$)"),
    MASK: re.compile(r"(^|[^a-z])masks?([^a-z]|$)"),
}
CONFIDENCE = re.compile(r"(^|[_-])conf(idence)?s?([_-]|$)")
# how a layout calls them; the others have none
BY_NAME = "it is called as its photo or by its number"
BY_LIST = "the capture's own list names each with its {}"
INSTEAD = {
    DEPTH: {
        **dict.fromkeys(("scannet", "neuralrgbd", "open3d", "polycam", "record3d", "scannetpp"), BY_NAME),
        **dict.fromkeys(("sevenscenes", "arkitscenes"), "it is called as its photo"),
        "replica": "it is called results/depth<number>.png by its photo's number",
        "stray": "it is called by the number of the video's frame, 000000.png",
        "tum": BY_LIST.format("time in depth.txt"),
        "nerfstudio": BY_LIST.format("photo as depth_file_path"),
        "sdfstudio": BY_LIST.format("photo as sensor_depth_path"),
    },
    MASK: {
        **dict.fromkeys(("colmap", "scannetpp"), "it is called as its photo, NAME.png or NAME.jpg.png"),
        "nerfstudio": BY_LIST.format("photo as mask_path"),
        "sdfstudio": BY_LIST.format("photo as foreground_mask"),
    },
}
# what such a folder may hold besides
OTHER_FILES = (".txt", ".json", ".md", ".csv", ".yaml", ".yml", ".xml", ".ini", ".db", ".log", ".html", ".pdf")
MOST_FOLDERS = 1000  # that are looked through below one


def unmatched(folder: Path, used: Collection[str], of_what: str, instead: str = "") -> str | None:
    """What to say of a folder's files that belong to no photo; None: there are none.

    Args:
        folder: of depth maps or masks; folders below it count too.
        used: names of the files that are used, relative to the folder, with slashes.
        of_what: what one of them is ("depth map").
        instead: how they should be called, or where they should be named; a part of a sentence.
    """
    names = natural(_files(folder))
    left = [name for name in names if name not in used]
    if not left:
        return None
    mend = instead or f"a {of_what} is called as its photo"
    if len(left) == len(names):
        files = "one file, and it is" if len(names) == 1 else f"{len(names)} files, and none is"
        return f"{folder} has {files} the {of_what} of a photo ({some(left)}), so nothing in it is used; {mend}"
    return f"{folder} has {len(names)} files, {len(left)} of them are the {of_what} of no photo ({some(left)}); {mend}"


def called_map(name: str) -> bool:
    """Whether a file's name, or that of a folder it lies in, says depth or mask.

    Args:
        name: with slashes.
    """
    *folders, last = name.lower().split("/")
    return any(pattern.search(folder) for pattern in FOLDERS.values() for folder in folders) or any(
        pattern.search(last) for pattern in FILES.values()
    )


def warn_unmatched(capture: Capture) -> None:
    """Add what `unmatched` says of the folders of depth maps and masks beside a capture's photos: a warning where none
    of a folder's files is used, a note where some are, or where another such folder is used in its place.
    """
    if not capture.root.is_dir():
        return
    used = {kind: _by_folder(capture, kind) for kind in FOLDERS}
    known = " ".join((*capture.notes, *capture.warnings))
    root = os.path.abspath(capture.root)
    for folder, kind in _beside(capture):
        names = used[kind].get(str(folder), set())
        shown = capture.root / os.path.relpath(folder, root)
        instead = INSTEAD[kind].get(capture.layout, f"the layout {capture.layout} reads no {kind}s from files")
        message = unmatched(shown, names, kind, instead) if f"{shown} " not in known else None  # the reader knows more
        lacking = _lacking(capture, kind) if message and names else 0
        if lacking:  # numbers may agree by chance, where photos and maps were counted differently
            message = f"{message}; {lacking} photos have none: if photos and maps are numbered differently, rename them"
        if message:
            (capture.warnings if lacking or not (names or used[kind]) else capture.notes).append(message)
    capture.notes.extend(_beside_photos(capture, used))
    if used[DEPTH]:
        capture.notes.extend(_confidences(capture))


def _lacking(capture: Capture, kind: str) -> int:
    """How many photos have no depth map, or no mask, though others have one."""
    return sum((shot.depth if kind == DEPTH else shot.mask) is None for shot in capture.shots)


def _beside_photos(capture: Capture, used: dict[str, dict[str, set[str]]]) -> Iterator[str]:
    """Notes on files in the photos' own folders that are called depth or mask and are not used."""
    photos: dict[str, set[str]] = {}
    for shot in capture.shots:
        folder, name = os.path.split(os.path.abspath(shot.path))
        photos.setdefault(folder, set()).add(name)
    for folder in list(photos)[:MOST_FOLDERS]:
        names = listed(Path(folder)) - photos[folder]
        for kind, pattern in FILES.items():
            found = {name for name in names if pattern.search(name.lower()) and not name.lower().endswith(OTHER_FILES)}
            left = natural(found - used[kind].get(folder, set()))
            left = [name for name in left if os.path.isfile(os.path.join(folder, name))]
            if left:
                words = "one file that is" if len(left) == 1 else f"{len(left)} files that are"
                yield f"{folder} has {words} called a {kind} and no photo's: {some(left)}"


def _confidences(capture: Capture) -> Iterator[str]:
    """Notes on folders that say how sure a sensor's depth is."""
    for place in _places(capture):
        for name in natural(listed(place)):
            count = len(listed(place / name)) if CONFIDENCE.search(name.lower()) else 0
            if count:
                yield (
                    f"{place / name} has {count} files that say how sure the depth is, which are not used: depth is "
                    "taken as it is"
                )


def _places(capture: Capture) -> dict[Path, None]:
    """The capture's folder, those of its photos and the ones above these."""
    root = Path(os.path.abspath(capture.root))
    places = {root: None}
    folders = dict.fromkeys(os.path.dirname(os.path.abspath(shot.path)) for shot in capture.shots)
    for photos in map(Path, list(folders)[:MOST_FOLDERS]):
        for place in (photos, photos.parent):
            if place.is_relative_to(root):
                places[place] = None
    return places


def _beside(capture: Capture) -> Iterator[tuple[Path, str]]:
    """Folders whose names say depth or masks: in the capture, and where its photos lie."""
    seen = {os.path.dirname(os.path.abspath(shot.path)) for shot in capture.shots}
    for place in _places(capture):
        for name in natural(listed(place)):
            kind = next((kind for kind, pattern in FOLDERS.items() if pattern.search(name.lower())), None)
            folder = place / name
            if kind and str(folder) not in seen and folder.is_dir():
                seen.add(str(folder))
                yield folder, kind


def _by_folder(capture: Capture, kind: str) -> dict[str, set[str]]:
    """Files that the shots use, by each folder above them, up to the capture's."""
    root = os.path.abspath(capture.root)
    found: dict[str, set[str]] = {}
    for shot in capture.shots:
        file = _file(shot, kind)
        path = os.path.abspath(file) if file else ""
        folder = os.path.dirname(path)
        while len(folder) >= len(root) and folder.startswith(root):
            found.setdefault(folder, set()).add(path[len(folder) + 1 :].replace(os.sep, "/"))
            folder = os.path.dirname(folder)
    return found


def _file(shot: Shot, kind: str) -> str | None:
    """Where a shot's depth or mask lies."""
    if kind == DEPTH:
        return None if shot.depth is None else str(getattr(shot.depth, "label", shot.depth))
    path = getattr(getattr(shot.mask, "photo", shot.mask), "path", None)  # which may be turned
    return None if path is None else str(path)


def _files(folder: Path) -> Iterator[str]:
    """Names of the files below a folder that may be maps."""
    for count, (place, folders, names) in enumerate(os.walk(folder)):
        if count >= MOST_FOLDERS:
            return
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        start = "" if place == str(folder) else Path(place).relative_to(folder).as_posix() + "/"
        for name in names:
            if not name.startswith(".") and not name.lower().endswith(OTHER_FILES):
                yield start + name
