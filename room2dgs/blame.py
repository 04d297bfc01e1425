"""Tells errors of the input and of the machine (disk, memory, limits) from faults of the program."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterator
from enum import Enum

from room2dgs.errors import InputError, first_line
from room2dgs.texts import shown_name


class Lack(Enum):
    """What a machine does not give, by the words for it."""

    ROOM = "the disk is full"
    SIZE = "a file may not grow larger"
    DISK = "the disk fails"
    WRITING = "the disk can only be read"
    FILES = "no more files can be opened"
    THREADS = "no more threads can be started"
    GPU_MEMORY = "the GPU has not enough memory"
    MEMORY = "there is not enough memory"


MENDS = {
    Lack.ROOM: "make room",
    Lack.SIZE: "raise the limit (ulimit -f), or write to another file system",
    Lack.DISK: "check it, and whether it is full",
    Lack.WRITING: "make it writable",
    Lack.FILES: "raise the limit (ulimit -n)",
    Lack.THREADS: "raise the limit (ulimit -u, ulimit -v, or the container's), or give render.threads=1",
    Lack.GPU_MEMORY: "give memory.gpu_mb=1000 or render.device=cpu, or smaller photos by scene.image_width=640",
    Lack.MEMORY: "give memory.cache_mb=500, or smaller photos by scene.image_width=640",
}
ERRNOS = {
    errno.ENOSPC: Lack.ROOM,
    errno.EDQUOT: Lack.ROOM,
    errno.EFBIG: Lack.SIZE,
    errno.EIO: Lack.DISK,
    errno.EROFS: Lack.WRITING,
    errno.EMFILE: Lack.FILES,
    errno.ENFILE: Lack.FILES,
    errno.EAGAIN: Lack.THREADS,
    errno.ENOMEM: Lack.MEMORY,
}
# What the file system says of a place that was given, or that lies in a folder that was given
PLACES = {
    errno.EISDIR: "is a folder where a file belongs; delete it, or give it another name",
    errno.ENOTDIR: "leads through a file where a folder belongs; delete that file, or give it another name",
    errno.EEXIST: "is there already, and no folder; delete it, or give it another name",
    errno.ENAMETOOLONG: "is a longer name than the file system allows; choose a shorter one",
    errno.ELOOP: "is a link that leads back to itself; delete it",
    errno.EACCES: "may not be read or written by this user; change its rights, or choose another place",
    errno.EPERM: "may not be changed by this user; change its rights, or choose another place",
}
# What libraries say instead of an errno: SQLite, C++'s streams and threads, OpenCV, PyTorch, ONNX Runtime, NumPy.
LIBRARY_MESSAGES = (
    (Lack.ROOM, r"no space left on device|database or disk is full|disk quota exceeded|is the disk full"),
    (Lack.SIZE, r"file too large|file size limit exceeded"),
    (Lack.DISK, r"disk i/o error|input/output error"),
    (Lack.WRITING, r"read-only file system|attempt to write a readonly database"),
    (Lack.FILES, r"too many open files"),
    (Lack.THREADS, r"can't start new thread|resource temporarily unavailable|thread creation failed"),
    (Lack.GPU_MEMORY, r"cuda[^\n]*out of memory|cudaerrormemoryallocation"),
    (
        Lack.MEMORY,
        r"bad_alloc|bad allocation|insufficient memory|failed to allocate|can't allocate|cannot allocate memory|"
        r"unable to allocate|not enough memory|out of memory|failed to map segment",
    ),
)


def lack(error: BaseException) -> Lack | None:
    """What of the machine an error comes from, itself or one that it came of; None: from something else."""
    return next((found for one in _chain(error) if (found := _lack_of(one))), None)


def by_the_machine(error: BaseException) -> bool:
    """Would the same input do on another machine, or on this one after some tidying?"""
    return lack(error) is not None


def error_sentence(error: BaseException, again: str = "") -> str | None:
    """One sentence for what is no mistake of ours; None where it may be one.

    Args:
        again: the command that goes on after a mend; without one, the same one.
    """
    found = lack(error)
    if isinstance(error, InputError) and found not in (Lack.ROOM, Lack.SIZE):
        return str(error)
    if found is None:
        return _place(error)
    on = f"go on with: {again}" if again else "type the same command again"
    what = _what(error)
    return f"{found.value}{what and f': {what}'}; {MENDS[found]}, then {on}"


def _place(error: BaseException) -> str | None:
    """What is wrong with the place that an error names."""
    if not isinstance(error, OSError) or error.errno not in PLACES or not isinstance(error.filename, str | os.PathLike):
        return None
    return f"{shown_name(os.fspath(error.filename))} {PLACES[error.errno]}"


def _what(error: BaseException) -> str:
    """What could not be done, as far as it was said."""
    if isinstance(error, InputError):
        return str(error).rpartition("; ")[0] or str(error)
    source = next(one for one in _chain(error) if _lack_of(one))
    if isinstance(source, OSError) and source.errno:
        where = f"{os.fspath(source.filename)}: " if isinstance(source.filename, str | os.PathLike) else ""
        return f"{where}{os.strerror(source.errno)}"
    if not str(source):
        return ""
    return re.sub(r"^\[[^]]*\] |; is the disk full\?$", "", first_line(source))


def _lack_of(error: BaseException) -> Lack | None:
    if isinstance(error, OSError) and error.errno is not None:
        return ERRNOS.get(error.errno)
    if isinstance(error, InputError) or not isinstance(error, Exception):
        return None  # our own words; what they came of counts
    if isinstance(error, MemoryError):
        return Lack.MEMORY
    text = str(error).lower()
    return next((kind for kind, pattern in LIBRARY_MESSAGES if re.search(pattern, text)), None)


def _chain(error: BaseException) -> Iterator[BaseException]:
    """The error and those that it came of, as Python shows them."""
    seen: set[int] = set()
    one: BaseException | None = error
    while one is not None and id(one) not in seen:
        seen.add(id(one))
        yield one
        one = one.__cause__ or (None if one.__suppress_context__ else one.__context__)
