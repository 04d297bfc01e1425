"""Chooses the reader of a capture."""

from __future__ import annotations

from room2dgs.captures.listing import Listing
from room2dgs.captures.reader import Reader
from room2dgs.captures.readers.not_known import not_known
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.logs import LOGGER
from room2dgs.registries.readers import READERS
from room2dgs.registry import Entry


def reader_of(config: SceneConfig, files: Listing) -> Entry[Reader]:
    """The reader that the settings name, or the one that recognises a capture by the names of its files.

    Raises:
        InputError: none does, or several do; or the reader comes from another package and cannot be imported.
    """
    if config.layout != "auto":
        return READERS.get(config.layout)
    found = recognised(files)
    if len(found) > 1:
        names = " and ".join(entry.name for entry in found)
        raise InputError(
            f"{files.root} looks like {names}; say which with "
            + " or ".join(f"scene.layout={entry.name}" for entry in found)
        )
    if not found:
        raise not_known(files, _names, READERS.load("scannet").needs)
    return found[0]


def recognised(files: Listing) -> list[Entry[Reader]]:
    """The readers of the layouts that a folder's or file's names look like."""
    found = [(entry, reader) for entry, reader in _readers() if reader.recognise(files)]
    contained = {name for _, reader in found for name in reader.contains}
    return [entry for entry, _ in found if entry.name not in contained]


def _readers() -> list[tuple[Entry[Reader], Reader]]:
    """All of them, but those of other packages that cannot be imported; a warning names these."""
    loaded = []
    for entry in READERS.entries():
        try:
            loaded.append((entry, entry.load()))
        except InputError as error:
            LOGGER.warning(f"warning: {error}")
    return loaded


def _names(files: Listing) -> str | None:
    """Of the layouts that fit, in words."""
    return " or ".join(entry.name for entry in recognised(files)) or None
