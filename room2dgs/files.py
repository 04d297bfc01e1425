"""Writes files and folders atomically: they are complete or not there."""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import shutil
import time
import tokenize
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from room2dgs.errors import InputError
from room2dgs.owner import LOCK, check_there

# what numpy raises when a .npy or .npz is damaged: it parses the header as Python, and each parser fails its own way
NUMPY_DAMAGE = (
    OSError, ValueError, TypeError, EOFError, KeyError, SyntaxError, OverflowError, MemoryError, RecursionError,
    tokenize.TokenError, zipfile.BadZipFile,
)  # fmt: skip
# .NAME.PROCESS-MACHINE.tmp and what SQLite puts beside it; .NAME.partial-PROCESS-MACHINE. Once there was no MACHINE.
TEMPORARY = re.compile(
    r"\.(?P<name>.+)\.(?P<kind>partial-|earlier-)?(?P<process>\d+)(-(?P<machine>[0-9a-f]{4}))?"
    r"(?(kind)|\.tmp(-journal|-wal|-shm)?)|\.sfm-\w{8}",
    re.DOTALL,
)
LONGEST_NAME = 255  # bytes
OWN = (LOCK, "config.yaml", "work")  # one of them is in a folder that is more than a part of the one around it
ABANDONED_S = 24 * 3600  # since the last change of what another machine may still write


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Gives a temporary path in the same folder to write to; flushes it to the disk and renames it at the end.

    A kill or a full disk at any moment leaves the file that was there before, or none.

    Raises:
        OSError: the disk refuses.
        FolderGone: the folder that this process works in is no longer there.
    """
    check_there(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{_mark()}.tmp")
    if len(os.fsencode(temporary.name)) > LONGEST_NAME:
        short = hashlib.sha256(os.fsencode(path.name)).hexdigest()[:16]
        temporary = path.with_name(f".{short}.{_mark()}.tmp")
    try:
        yield temporary
        _flush(temporary)
        os.replace(temporary, path)
        _flush(path.parent)  # the rename itself
    except OSError as error:
        if error.errno and error.filename in (None, str(temporary)):  # writing does not say where
            error.filename = str(path)
        raise
    finally:
        with suppress(OSError):  # a disk that refused to write may refuse this, too, and what it said first counts
            temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Gives an empty temporary folder beside `path` to fill, which takes the place of `path` at the end.

    When anything fails, what was at `path` before is there again.

    Raises:
        InputError: the disk refuses.
    """
    path = path.absolute()
    check_there(path)
    partial = path.with_name(f".{path.name}.partial-{_mark()}")
    earlier = path.with_name(f".{path.name}.earlier-{_mark()}")
    try:
        for leftover in (earlier, partial):  # of a process that had our number
            _put_away(leftover)
        partial.mkdir(parents=True)
        yield partial
        if path.exists():
            os.replace(path, earlier)
        os.replace(partial, path)
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({error.strerror or error}); choose another folder or free some space"
        ) from error
    finally:
        if earlier.exists() and not path.exists():
            os.replace(earlier, path)
        shutil.rmtree(partial, ignore_errors=True)
        shutil.rmtree(earlier, ignore_errors=True)


@contextmanager
def scratch_folder(parent: Path, what: str) -> Iterator[Path]:
    """An empty folder in `parent` for the length of the block; what a kill leaves of it `remove_leftovers` finds."""
    check_there(parent / what)
    folder = parent / f".{what}.partial-{_mark()}"
    _put_away(folder)
    folder.mkdir(parents=True)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def check_room(folder: Path, size: int) -> None:
    """Fails as writing a file of so many bytes would, before a library writes that aborts where the disk is full.

    Raises:
        OSError: there is no room, or no file may be so large.
    """
    check_there(folder / "room")
    probe = folder / f".room.{_mark()}.tmp"
    try:
        with probe.open("wb") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, max(1, size))
    except OSError as error:
        if error.errno in (errno.EOPNOTSUPP, errno.EINVAL):
            return
        raise OSError(error.errno, error.strerror, str(folder)) from error
    finally:
        with suppress(OSError):
            probe.unlink(missing_ok=True)


def is_temporary(name: str) -> bool:
    """Is it what `whole_file`, `whole_folder` or `scratch_folder` call theirs until they end?"""
    return TEMPORARY.fullmatch(name) is not None


def remove_leftovers(folder: Path, owned: bool = False) -> None:
    """Delete what writing left in a folder when its process was killed; a folder that was being replaced comes back.

    Nothing is deleted that a living process may still write: unless the folder is owned, of this machine what belongs
    to no process, and of others what nobody has touched for a day.

    Args:
        owned: this process alone writes there (`owner.owned`), and has not begun.
    """
    with suppress(OSError):
        for path in sorted(folder.iterdir()):
            found = TEMPORARY.fullmatch(path.name)
            if found and (owned or _is_abandoned(path, found)):
                _put_away(path)


def remove_all_leftovers(folder: Path) -> None:
    """`remove_leftovers` of a folder that this process owns, and of all folders in it but those that others may own.

    No link is followed.
    """
    remove_leftovers(folder, owned=True)
    with suppress(OSError):
        for path in sorted(folder.iterdir()):
            if path.is_dir() and not path.is_symlink() and not any((path / name).exists() for name in OWN):
                remove_all_leftovers(path)


def _mark() -> str:
    return f"{os.getpid()}-{_machine()}"


def _machine() -> str:
    """Stands for where the number of a process means that process: the machine, and in it the container."""
    try:
        container = os.readlink("/proc/self/ns/pid")
    except OSError:
        container = ""
    return hashlib.sha256(f"{platform.node()} {container}".encode()).hexdigest()[:4]


def _is_abandoned(path: Path, found: re.Match[str]) -> bool:
    if found["machine"] == _machine():
        return int(found["process"]) != os.getpid() and not _lives(int(found["process"]))
    with suppress(OSError):
        inside = path.iterdir() if path.is_dir() and not path.is_symlink() else ()
        latest = max(one.lstat().st_mtime for one in (path, *inside))
        return time.time() - latest > ABANDONED_S
    return False


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _put_away(path: Path) -> None:
    """Without a leftover; a folder that was being replaced is itself again where nothing has taken its place."""
    found = TEMPORARY.fullmatch(path.name)
    target = path.with_name(found["name"]) if found and found["name"] else None
    if found and target and found["kind"] == "earlier-" and path.exists() and not target.exists():
        os.replace(path, target)
    elif path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    """Flush a file or a folder to the disk; a folder only where the system can."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:
        if not path.is_dir():
            raise
    finally:
        os.close(handle)
