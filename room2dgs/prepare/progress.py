"""Progress of a long stage in the log."""

from __future__ import annotations

import time

from room2dgs.logs import Log

REPORT_SECONDS = 8.0


class Progress:
    """A line every few seconds while something goes on."""

    def __init__(self, log: Log, what: str, total: int | None, unit: str) -> None:
        self.log, self.what, self.total, self.unit = log, what, total, unit
        self.start = self.last = time.monotonic()

    def at(self, count: int) -> None:
        """So many are done."""
        now = time.monotonic()
        if now - self.last < REPORT_SECONDS:
            return
        self.last = now
        of = f" of {self.total}" if self.total else ""
        left = ""
        if self.total and count:
            left = f", about {(now - self.start) / count * max(0, self.total - count):.0f} s left"
        self.log(f"{self.what}: {count}{of} {self.unit}{left}")
