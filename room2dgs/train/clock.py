"""Where an iteration's time goes."""

from __future__ import annotations

import time

STAGES = ("data", "render", "loss", "multiview", "backward", "optimiser", "strategy")


class StageClock:
    """Seconds by stage; a lap costs well under a microsecond's worth of an iteration.

    Attributes:
        seconds: by stage, summed over laps.
    """

    def __init__(self, seconds: dict[str, float] | None = None) -> None:
        self.seconds = {stage: 0.0 for stage in STAGES} | (seconds or {})
        self._last = time.perf_counter()

    def start(self) -> None:
        """Forget the time since the last lap (it belongs to no stage)."""
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Count the time since `start` or the last lap to `stage`."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
