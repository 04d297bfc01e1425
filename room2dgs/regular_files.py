"""Opens only regular files: a pipe or a device would block or never end."""

from __future__ import annotations

import errno
import os
import stat
import unicodedata
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

from room2dgs.errors import InputError

KINDS = (
    (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)  # fmt: skip
COPY_AGAIN = "copy the capture again"
# what Git leaves in a large file's place where Git LFS did not fetch it; such a text is short
POINTER, POINTER_BYTES = b"version https://git-lfs.github.com/spec/", 1024


def open_regular(path: Path, mend: str = COPY_AGAIN) -> BinaryIO:
    """A regular file, open for reading; links are followed.

    Args:
        mend: what to do about a file that is missing, without a point at its end.

    Raises:
        InputError: it is missing (or there in other letters), a link to nothing, a folder, a pipe, a device, or may not
            be read, or is Git LFS's pointer to the file: each has its own sentence.
    """
    path = Path(path)
    try:
        # a pipe that nobody writes to would block here without O_NONBLOCK
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | getattr(os, "O_CLOEXEC", 0))
    except (OSError, ValueError) as error:
        raise refusal(path, error, mend) from error
    try:
        found = os.fstat(handle)
        kind = not_regular(found.st_mode)
        if kind:
            raise InputError(f"{path} is {kind} where a file belongs; {mend}")
        if found.st_size <= POINTER_BYTES and _is_pointer(handle):
            raise InputError(f"{path} is a pointer of Git LFS and not the file itself; run git lfs pull")
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def check_regular(path: Path, mend: str = COPY_AGAIN) -> int:
    """A regular file's size in bytes; for libraries that open by name.

    Raises:
        InputError: as `open_regular`.
    """
    path = Path(path)
    try:
        found = os.stat(path)
    except (OSError, ValueError) as error:
        raise refusal(path, error, mend) from error
    kind = not_regular(found.st_mode)
    if kind:
        raise InputError(f"{path} is {kind} where a file belongs; {mend}")
    if found.st_size <= POINTER_BYTES:
        open_regular(path, mend).close()
    return found.st_size


def read_regular(path: Path, longest: int, mend: str = COPY_AGAIN) -> bytes:
    """The whole content of a regular file, whose size is looked at first.

    Args:
        longest: bytes that such a file may have.

    Raises:
        InputError: as `open_regular`; it is empty or larger than `longest`.
    """
    with open_regular(path, mend) as file:
        size = os.fstat(file.fileno()).st_size
        if not size:
            raise InputError(f"{path} is empty (0 bytes); {mend}")
        if size > longest:
            raise InputError(f"{path} has {size >> 20} MiB, too large for what it should hold; replace the file")
        try:
            return file.read(size)  # memory for no more than there is
        except OSError as error:
            raise InputError(f"{path} cannot be read ({error.strerror}); check the file") from error


def _is_pointer(handle: int) -> bool:
    try:
        return os.pread(handle, len(POINTER), 0) == POINTER
    except OSError:  # whoever reads it tells
        return False


def not_regular(mode: int) -> str | None:
    """What a file is that is no regular one ("a folder"); None: it is one."""
    if stat.S_ISREG(mode):
        return None
    return next((name for is_it, name in KINDS if is_it(mode)), "no regular file")


def refusal(path: Path, error: OSError | ValueError, mend: str = COPY_AGAIN) -> InputError:
    """The sentence for a file that cannot be opened."""
    path = Path(path)
    if not isinstance(error, OSError) or error.errno is None:  # a zero byte in the name
        return InputError(f"{path} cannot be the name of a file; {mend}")
    code = error.errno
    if code == errno.ELOOP:
        return InputError(f"{path} is a link that leads back to itself; copy the file itself")
    if code not in (errno.ENOENT, errno.ENOTDIR):
        return InputError(f"{path} cannot be read ({error.strerror}); check the file's rights")
    if os.path.islink(path):
        return InputError(f"{path} is a link to {os.readlink(path)}, which is not there; copy the file itself")
    alike = written_otherwise(path)
    if alike:
        difference = how(path.name, alike)
        return InputError(f"{path} is missing, but {alike} is there beside it, which {difference}; rename it")
    return InputError(f"{path} is missing; {mend}")


def written_otherwise(path: Path) -> str | None:
    """A name in the same folder that differs in case or in its Unicode form alone."""
    try:
        names = _by_plain(os.fspath(path.parent), os.stat(path.parent).st_mtime_ns)
    except (OSError, ValueError):
        return None
    return names.get(_plain(path.name))


@lru_cache(maxsize=16)  # of a list whose every file is missing, each one asks
def _by_plain(folder: str, _changed_ns: int) -> dict[str, str]:
    """The first name in a folder of each plain form."""
    return {_plain(name): name for name in sorted(os.listdir(folder), reverse=True)}


def how(wanted: str, found: str) -> str:
    """How two names differ that `written_otherwise` takes for one."""
    if unicodedata.normalize("NFC", wanted) == unicodedata.normalize("NFC", found):
        return "has the same letters in another Unicode form"
    return "differs in upper and lower case"


def _plain(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()
