"""One process works in a folder at a time, by a lock that the system releases when the process ends."""

from __future__ import annotations

import errno
import fcntl
import os
import platform
import stat
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from room2dgs.errors import InputError

LOCK = ".lock"  # says process and machine, for the sentence; the lock itself is the system's
TRIES, PAUSE_S = 10, 0.02  # somebody may be looking whether the folder is free
WITHOUT_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL, errno.EIO, errno.EBADF)
CHOOSE = "choose another out=DIR"


class FolderGone(InputError):
    """The folder that a process works in was removed, or another lies in its place."""


@dataclass
class _Held:
    """A folder that this process owns.

    Attributes:
        folder: absolute.
        folder_handle: open as long as it is held, so that no other folder gets its inode.
        lock_handle: of the file `LOCK` in it.
        thread: that took it; may take it again, inside.
    """

    folder: Path
    folder_handle: int
    lock_handle: int
    thread: int = field(default_factory=threading.get_ident)


_held: list[_Held] = []


@contextmanager
def owned(folder: Path, log: Callable[[str], None] = print, writes: bool = True) -> Iterator[None]:
    """The folder is this process's alone while the block runs; it is made if needed. Blocks may be nested.

    Nothing is left of the lock at the end, nor of a folder that was made for it and is empty then.

    Args:
        log: takes a line where the file system has no locks, and nobody is kept out.
        writes: False: a folder that cannot be written is used without a lock.

    Raises:
        InputError: another process works there, or the folder cannot be written.
        FolderGone: at the end: the folder was removed meanwhile; whatever went wrong, this is why.
    """
    folder = Path(os.path.abspath(folder))
    if any(one.thread == threading.get_ident() for one in _holding(folder)):
        yield
        return
    made, held = not folder.exists(), None
    try:
        held = _taken(folder, log)
    except OSError as error:
        if writes:
            raise InputError(f"{folder} cannot be written ({error.strerror}); {CHOOSE}") from error
    if held is None:
        yield
        return
    try:
        yield
        _check(held)
    except Exception as error:
        if not isinstance(error, FolderGone):
            _check(held, error)
        raise
    finally:
        _release(held, made)


def refuse_if_owned(folder: Path) -> None:
    """At once, before anything is read: without taking the folder.

    Raises:
        InputError: another process works there.
    """
    folder = Path(os.path.abspath(folder))
    if any(one.thread == threading.get_ident() for one in _holding(folder)):
        return
    try:
        handle = _opened(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        _lock(handle, fcntl.LOCK_SH, folder)
    finally:
        os.close(handle)


def check_there(path: Path) -> None:
    """Before something is written: is the folder that this process owns around `path` still the same one?

    Raises:
        FolderGone: it was removed. What is written would make it again, with half of a run in it.
    """
    place = os.path.abspath(path)
    for held in tuple(_held):
        if place.startswith(f"{held.folder}{os.sep}"):
            _check(held)


def _taken(folder: Path, log: Callable[[str], None]) -> _Held:
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            lock = _opened(folder, os.O_RDWR | os.O_CREAT)
        except FileNotFoundError:
            if folder.exists():
                raise
            continue  # who had it before has just removed the folder
        try:
            locked = _lock(lock, fcntl.LOCK_EX, folder)
            if not locked:
                log(f"WARNING: {folder} lies on a file system without locks: start nothing else that writes there")
            if not _same(lock, folder / LOCK):  # who had it before has just removed the file
                os.close(lock)
                continue
            _write_name(lock)
            held = _Held(folder, os.open(folder, os.O_RDONLY | os.O_DIRECTORY), lock)
        except BaseException:
            with suppress(OSError):
                os.close(lock)
            raise
        _held.append(held)
        return held


def _opened(folder: Path, how: int) -> int:
    """The lock's file, which is nobody else's: no link is followed, no pipe is waited for.

    Raises:
        InputError: something else lies in its place.
    """
    path = folder / LOCK
    flags = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        handle = os.open(path, how | flags, 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
            raise InputError(f"{path} is no file of a lock; delete it") from error
        if error.errno not in (errno.EACCES, errno.EPERM) or not how & os.O_CREAT or not path.exists():
            raise
        handle = os.open(path, os.O_RDONLY | flags)  # another user's, in a folder that several may write to
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise InputError(f"{path} is no file of a lock; delete it")
    return handle


def _lock(handle: int, kind: int, folder: Path) -> bool:
    """False: the file system has no locks.

    Raises:
        InputError: another process has it.
    """
    for attempt in range(TRIES):
        try:
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
            return True
        except OSError as error:
            if error.errno in WITHOUT_LOCKS:
                return False
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
        if attempt + 1 < TRIES:
            time.sleep(PAUSE_S)
    raise InputError(f"another run works in {folder}{_name(handle)}; wait for it or {CHOOSE}")


def _write_name(handle: int) -> None:
    with suppress(OSError):  # a full disk, or another user's file: the lock holds all the same
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"{os.getpid()} {platform.node()}\n".encode(), 0)


def _name(handle: int) -> str:
    try:
        process, _, machine = os.pread(handle, 300, 0).decode("utf-8", "replace").strip().partition(" ")
    except OSError:
        return ""
    if not process.isdigit():
        return ""
    return f" (process {process})" if machine in ("", platform.node()) else f" (process {process} on {machine})"


def _holding(folder: Path) -> list[_Held]:
    return [held for held in _held if _same(held.folder_handle, folder)]


def _same(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except OSError:
        return False


def _check(held: _Held, cause: BaseException | None = None) -> None:
    if not _same(held.folder_handle, held.folder):
        raise FolderGone(
            f"{held.folder} was removed while the run worked in it; start the run again, or with resume=true where the "
            "folder is now"
        ) from cause


def _release(held: _Held, made: bool) -> None:
    _held.remove(held)
    with suppress(OSError):
        if _same(held.lock_handle, held.folder / LOCK):
            (held.folder / LOCK).unlink()
            if made:
                held.folder.rmdir()
    for handle in (held.lock_handle, held.folder_handle):
        with suppress(OSError):
            os.close(handle)


def _after_fork() -> None:
    """A forked process owns nothing; the lock stays its parent's alone."""
    for held in _held:
        for handle in (held.lock_handle, held.folder_handle):
            with suppress(OSError):
                os.close(handle)
    _held.clear()


os.register_at_fork(after_in_child=_after_fork)
