"""Zip archives of phone apps, read in place: nothing is unpacked to the disk, and no entry beyond what it may be."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

from room2dgs.errors import InputError

MAX_ENTRIES = 1_000_000
MAX_ENTRY_BYTES = 256 << 20
DAMAGE = (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, KeyError)


class Archive:
    """A zip archive. Names count from where its one top folder begins, if it has one.

    Attributes:
        path: of the file.
        names: of its files.

    Raises:
        InputError: it is none.
    """

    def __init__(self, path: Path, within: str = "") -> None:
        self.path = path
        try:
            with zipfile.ZipFile(path) as archive:
                entries = {entry.filename: entry for entry in archive.infolist() if not entry.is_dir()}
        except DAMAGE as error:
            raise InputError(f"{path} cannot be read as a zip archive; export it again") from error
        if len(entries) > MAX_ENTRIES:
            raise InputError(f"{path} holds {len(entries)} files; export it again")
        self._prefix = _prefix(entries, within)
        self._sizes = {
            name.removeprefix(self._prefix): entry.file_size
            for name, entry in entries.items()
            if name.startswith(self._prefix)
        }
        self.names = frozenset(self._sizes)

    def read(self, name: str) -> bytes:
        """A file's content; its announced size is looked at first.

        Raises:
            InputError: missing, damaged or too large.
        """
        size = self._sizes.get(name)
        if size is None:
            raise InputError(f"{self.path} has no {name}; export it again")
        if size > MAX_ENTRY_BYTES:
            raise InputError(f"{self.path} has a {name} of {size >> 20} MiB; export it again")
        try:
            with zipfile.ZipFile(self.path) as archive, archive.open(self._prefix + name) as file:
                data = file.read(size + 1)
        except DAMAGE as error:
            raise InputError(f"{self.path} has a damaged {name}; export it again") from error
        if len(data) != size:
            raise InputError(f"{self.path} has a {name} that is not as large as it says; export it again")
        return data


def _prefix(names, within: str) -> str:
    """The folder that holds the file or folder `within`; none if that lies at the top."""
    for name in sorted(names, key=len):
        place = f"/{name}".find(f"/{within}")
        if within and place >= 0:
            return name[:place]
    return ""
