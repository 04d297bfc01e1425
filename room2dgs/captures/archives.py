"""Zip archives of phone apps, read in place: nothing is unpacked to the disk, and no entry may exceed its expected
size.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any, BinaryIO

from room2dgs.errors import InputError
from room2dgs.regular_files import open_regular

MAX_DIRECTORY_BYTES = 16 << 20  # of the list of files: ten minutes of Record3D have 9 MiB
MAX_ENTRY_BYTES = 256 << 20
DAMAGE = (
    OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, KeyError,
    struct.error,
)  # fmt: skip
FILE_HEADER, FILE_MAGIC = struct.Struct("<26xHH"), b"PK\3\4"
ENCRYPTED = 1


class Archive:
    """A zip archive. Names count from where its one top folder begins, if it has one.

    Attributes:
        path: of the file.
        names: of its files.

    Raises:
        InputError: it is none, or lists more files than a capture has.
    """

    def __init__(self, path: Path, within: str = "") -> None:
        self.path = path
        try:
            with open_regular(path) as file, zipfile.ZipFile(_ShortReads(file)) as archive:
                entries = {entry.filename: entry for entry in archive.infolist() if not entry.is_dir()}
        except _TooLong as error:
            raise InputError(
                f"{path} lists more files than a capture has (the list has {error.size >> 20} MiB); export it again"
            ) from error
        except InputError:
            raise
        except DAMAGE as error:
            raise InputError(f"{path} cannot be read as a zip archive; export it again") from error
        prefix = _prefix(entries, within)
        self._entries = {name.removeprefix(prefix): entry for name, entry in entries.items() if name.startswith(prefix)}
        self.names = frozenset(self._entries)

    def read(self, name: str) -> bytes:
        """A file's content; its announced size is looked at first. The list of files is not read again.

        Raises:
            InputError: missing, damaged or too large.
        """
        entry = self._entries.get(name)
        if entry is None:
            raise InputError(f"{self.path} has no {name}; export it again")
        size = entry.file_size
        if max(size, entry.compress_size) > MAX_ENTRY_BYTES:
            raise InputError(f"{self.path} has a {name} of {size >> 20} MiB; export it again")
        with open_regular(self.path) as file:
            try:
                data = _content(file, entry)
            except DAMAGE as error:
                raise InputError(f"{self.path} has a damaged {name}; export it again") from error
        if len(data) != size:
            raise InputError(f"{self.path} has a {name} that is not as large as it says; export it again")
        if zlib.crc32(data) != entry.CRC:
            raise InputError(f"{self.path} has a damaged {name}; export it again")
        return data


class _TooLong(Exception):
    def __init__(self, size: int) -> None:
        super().__init__(size)
        self.size = size


class _ShortReads:
    """A file of which nothing long is read: zipfile takes the whole list of files at once, before it counts them."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int = -1) -> bytes:
        if size > MAX_DIRECTORY_BYTES:
            raise _TooLong(size)
        return self._file.read(size)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def _content(file: BinaryIO, entry: zipfile.ZipInfo) -> bytes:
    """An entry's bytes, one more at most than it announces."""
    if entry.flag_bits & ENCRYPTED:
        raise zipfile.BadZipFile("it is encrypted")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        with zipfile.ZipFile(_ShortReads(file)) as archive, archive.open(entry) as packed:
            return packed.read(entry.file_size + 1)
    file.seek(entry.header_offset)
    header = file.read(FILE_HEADER.size)
    if not header.startswith(FILE_MAGIC):
        raise zipfile.BadZipFile("its header is not there")
    file.seek(sum(FILE_HEADER.unpack(header)), 1)
    data = file.read(entry.compress_size)
    if entry.compress_type == zipfile.ZIP_STORED:
        return data
    return zlib.decompressobj(-zlib.MAX_WBITS).decompress(data, entry.file_size + 1)


def _prefix(names, within: str) -> str:
    """The folder that holds the file or folder `within`; none if that lies at the top."""
    for name in sorted(names, key=len):
        place = f"/{name}".find(f"/{within}")
        if within and place >= 0:
            return name[:place]
    return ""
