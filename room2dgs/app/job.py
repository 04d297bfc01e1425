"""A run in a process of its own, which says how far it is and can be stopped."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections import deque
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from room2dgs.app.sources import quoted

LINES = 200  # of the log that are kept for the page
EVERY_S = 0.5
GRACE_S = 5.0  # for what is cleaned up after a stop
RUNNING, DONE, FAILED, STOPPED = "running", "done", "failed", "stopped"


class Job:
    """One run.

    Attributes:
        name: of its folder.
    """

    def __init__(self, name: str, out: Path, overrides: Sequence[str]) -> None:
        self.name = name
        self._state: dict[str, Any] = {"state": RUNNING, "share": 0.0, "left_s": None, "what": "starting", "why": ""}
        self._lines: deque[str] = deque(maxlen=LINES)
        self._lock = threading.Lock()
        context = multiprocessing.get_context("spawn")  # a process that has threads cannot be forked safely
        here, there = context.Pipe(duplex=False)
        self._process = context.Process(target=work, args=([*overrides, f"out={quoted(out)}"], there))
        self._process.start()
        there.close()
        threading.Thread(target=self._listen, args=(here,), daemon=True).start()

    @property
    def running(self) -> bool:
        return self._state["state"] == RUNNING

    def state(self) -> dict[str, Any]:
        """For the page: name, state, share, left_s, what, why it failed, last lines of the log."""
        with self._lock:
            return {"name": self.name, **self._state, "lines": list(self._lines)}

    def stop(self) -> None:
        """Ends it; what was finished is kept, and `room2dgs run out=... resume=true` goes on."""
        with self._lock:
            if self._state["state"] != RUNNING:
                return
            self._state["state"] = STOPPED
        self._process.terminate()
        self._process.join(GRACE_S)
        if self._process.is_alive():
            self._process.kill()

    def wait(self, seconds: float) -> None:
        """Until it has ended, or so long."""
        end = time.monotonic() + seconds
        while self.running and time.monotonic() < end:
            time.sleep(0.05)

    def _listen(self, here: Connection) -> None:
        while True:
            try:
                kind, value = here.recv()
            except (EOFError, OSError):
                break
            with self._lock:
                if kind == "line":
                    self._lines.append(value)
                elif self._state["state"] == RUNNING:
                    self._state |= value
        self._process.join()
        with self._lock:
            if self._state["state"] == RUNNING:  # it said nothing of its end: the system ended it
                self._state |= {"state": FAILED, "why": f"the run ended without a word (code {self._process.exitcode})"}


def work(overrides: list[str], back: Connection) -> None:
    """The process: a run that tells how far it is."""
    from room2dgs.blame import error_sentence
    from room2dgs.freed_memory import one_arena
    from room2dgs.interrupts import signals_raise
    from room2dgs.pipeline.progress import Progress

    one_arena()
    progress = Progress()
    over = threading.Event()
    lock = threading.Lock()

    def send(kind: str, value: Any) -> None:
        with lock:
            try:
                back.send((kind, value))
            except OSError:  # the server is gone, and nobody wants the run any more
                os._exit(1)

    def far() -> None:
        while not over.wait(EVERY_S):
            send("state", {"share": progress.share(), "left_s": progress.left_s(), "what": progress.what})

    def heard(line: str) -> None:
        progress.tell(line)
        send("line", line)

    threading.Thread(target=far, daemon=True).start()
    with signals_raise():
        try:
            from room2dgs.pipeline.reconstruct import start_run

            start_run(overrides, heard, progress)
            last: dict[str, Any] = {"state": DONE, "share": 1.0, "left_s": 0.0, "what": "done"}
        except KeyboardInterrupt:
            last = {"state": STOPPED}
        except Exception as error:
            last = {"state": FAILED, "why": error_sentence(error, "") or f"{type(error).__name__}: {error}"}
    over.set()
    send("state", last)
    back.close()
