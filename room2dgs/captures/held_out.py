"""The views that a capture's own split holds out; names match with or without folders and suffixes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import PurePosixPath

from room2dgs.captures.capture import Capture, file_name
from room2dgs.captures.left_out import some
from room2dgs.captures.listing import natural


def held_out(capture: Capture) -> tuple[frozenset[str] | None, list[str]]:
    """Names of the frames that the capture holds out, and warnings of names that are no photo's.

    Returns:
        None instead of names where the capture has no split, or one none of whose names is a photo's.
    """
    if not capture.test:
        return (None if capture.test is None else frozenset()), []
    frames = {shot.name: file_name(shot.name) for shot in capture.shots}
    by_frame = {frame: frame for frame in frames.values()}
    bare = _only((PurePosixPath(_slashes(name)).name, frame) for name, frame in frames.items())
    stems = _only((PurePosixPath(_slashes(name)).stem, frame) for name, frame in frames.items())
    found, unknown = set(), []
    for name in natural(capture.test):
        last = PurePosixPath(_slashes(name))
        frame = frames.get(name) or by_frame.get(_frame(name) or "") or bare.get(last.name) or stems.get(last.name)
        found |= {frame} if frame else set()
        unknown += [] if frame else [name]
    if not unknown:
        return frozenset(found), []
    message = f"the capture's split names {len(capture.test)} photos to hold out"
    if found:
        return frozenset(found), [f"{message}, {len(unknown)} of which it does not have ({some(unknown)})"]
    return None, [
        f"{message} and has none of them ({some(unknown)}), so that it is not used: every scene.test_every-th is held "
        "out"
    ]


def _only(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Key -> frame, of keys that one frame has."""
    found: dict[str, str | None] = {}
    for key, frame in pairs:
        found[key] = None if key in found else frame
    return {key: frame for key, frame in found.items() if frame}


def _slashes(name: str) -> str:
    return name.replace("\\", "/")


def _frame(name: str) -> str | None:
    return file_name(name) if name.strip("./\\ ") else None
