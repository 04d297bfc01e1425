"""Ends of a command that are no error: Ctrl-C, SIGTERM, and a closed pipe behind the output."""

from __future__ import annotations

import io
import os
import select
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType


class Terminated(KeyboardInterrupt):
    """SIGTERM arrived. Whoever cleans up after Ctrl-C cleans up after this."""


# Python code that is called from where an exception is lost: nanobind asks a tensor for its memory twice and forgets
# what the first call raised; destructors and weakref callbacks have nobody to raise to.
_DEAF = ("__dlpack__", "__dlpack_device__", "__del__")
_DEAF_CODE = weakref.finalize.__call__.__code__
_LATER_S = 0.005
GRACE_S = 1.5  # for the cleaning up after a stop; libraries that do not hear of it may take minutes


@contextmanager
def signals_raise() -> Iterator[None]:
    """SIGTERM raises `Terminated` in the main thread, as Ctrl-C raises KeyboardInterrupt; neither is ever lost."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {signum: signal.getsignal(signum) for signum in (signal.SIGTERM, signal.SIGINT, signal.SIGALRM)}
    signal.signal(signal.SIGTERM, _terminated)
    if before[signal.SIGINT] is signal.default_int_handler:  # a shell's background job ignores Ctrl-C
        signal.signal(signal.SIGINT, _interrupted)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for signum, handler in before.items():
            signal.signal(signum, handler)


@contextmanager
def ends_soon(end: Callable[[int], None]) -> Iterator[None]:
    """Ctrl-C and SIGTERM end the block, or `end` is called `GRACE_S` later, from a thread: a library's function that
    is at work lets no exception through before it returns.

    Args:
        end: takes the signal, and ends the process.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard, told = os.pipe()
    os.set_blocking(told, False)
    before = signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    watch = threading.Thread(target=_watch, args=(heard, end), name="interrupts", daemon=True)
    started = True
    try:
        watch.start()
    except RuntimeError:  # the system starts no more threads; the command itself says so
        started = False
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(told)
        if started:
            watch.join()
        os.close(heard)


def _watch(heard: int, end: Callable[[int], None]) -> None:
    """Reads the numbers of signals, which Python writes as they arrive; nothing once the block has ended."""
    while signum := os.read(heard, 1):
        if signum[0] in (signal.SIGINT, signal.SIGTERM):
            latest = time.monotonic() + GRACE_S
            while (left := latest - time.monotonic()) > 0:
                if select.select([heard], [], [], left)[0] and not os.read(heard, 1):
                    return
            end(signum[0])


@contextmanager
def sigterm_kept() -> Iterator[None]:
    """Around the import of a library that takes SIGTERM for itself and prints a stack of C++ (glog does)."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread() and before is not None:
            signal.signal(signal.SIGTERM, before)


def unread() -> bool:
    """Whether what we printed found no reader (`| head`). If so, what is still to be printed goes nowhere, silently."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _silence()
        return True
    return False


def reader_is_gone() -> bool:
    """After a BrokenPipeError: whether it was our output that broke. If so, the rest of it goes nowhere, silently."""
    try:
        output = select.poll()
        output.register(sys.stdout.fileno(), 0)  # errors are told unasked
        gone = any(event & (select.POLLERR | select.POLLHUP) for _, event in output.poll(0))
    except (OSError, io.UnsupportedOperation):
        return False
    if gone:
        _silence()
    return gone


def _silence() -> None:
    with suppress(OSError, io.UnsupportedOperation):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _terminated(signum: int, frame: FrameType | None) -> None:
    _raise(Terminated, frame)


def _interrupted(signum: int, frame: FrameType | None) -> None:
    _raise(KeyboardInterrupt, frame)


def _raise(stop: type[KeyboardInterrupt], frame: FrameType | None) -> None:
    """Raises, or a moment later if nobody would hear it here."""
    while frame is not None:
        if frame.f_code.co_name in _DEAF or frame.f_code is _DEAF_CODE:
            signal.signal(signal.SIGALRM, lambda _, later: _raise(stop, later))
            signal.setitimer(signal.ITIMER_REAL, _LATER_S)
            return
        frame = frame.f_back
    raise stop
