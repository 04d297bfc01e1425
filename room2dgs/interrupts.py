"""What ends a command early without being anybody's fault: Ctrl-C, SIGTERM, a reader of the output that goes away."""

from __future__ import annotations

import io
import os
import select
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType


class Terminated(KeyboardInterrupt):
    """SIGTERM arrived. Whoever cleans up after Ctrl-C cleans up after this."""


@contextmanager
def sigterm_raises() -> Iterator[None]:
    """SIGTERM raises `Terminated` in the main thread, as Ctrl-C raises KeyboardInterrupt."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _terminated)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


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
    raise Terminated
