"""Figures of a run in progress: time by stage, means, a bar on a terminal, tensorboard."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Column
from torch import Tensor

STAGES = ("data", "render", "loss", "multiview", "backward", "optimiser", "strategy")
REFRESH = 10  # iterations between two updates of the bar


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


class Means:
    """Running means by name since the last `pop`; a name may come in some iterations only."""

    def __init__(self) -> None:
        self._values: dict[str, list[float | Tensor]] = {}

    def add(self, values: dict[str, float | Tensor]) -> None:
        """One value each of some names; scalars of a GPU stay there until they are taken."""
        for name, value in values.items():
            self._values.setdefault(name, []).append(value)

    def pop(self) -> dict[str, float]:
        """The means, and start anew."""
        means = {name: _mean(values) for name, values in self._values.items()}
        self._values = {}
        return means


def _mean(values: list[float | Tensor]) -> float:
    there = [value for value in values if isinstance(value, Tensor)]
    here: list[float] = torch.stack(there).tolist() if there else [float(value) for value in values]
    return sum(here) / len(here)


def columns() -> list[ProgressColumn]:
    """Bar, count and time, whole on every terminal; the figures have the room that is left."""
    rest = Column(ratio=1, no_wrap=True, overflow="ellipsis")
    return [
        BarColumn(20, table_column=Column(no_wrap=True, min_width=20)),
        TextColumn("{task.completed}/{task.total}", table_column=Column(no_wrap=True)),
        TimeRemainingColumn(table_column=Column(no_wrap=True, min_width=7)),
        TextColumn("{task.fields[figures]}", table_column=rest),
    ]


class Bar:
    """A progress bar on a terminal; nothing elsewhere, where the log lines do."""

    def __init__(self, total: int, done: int, wanted: bool = True) -> None:
        self._progress: Progress | None = None
        if wanted and sys.stderr.isatty():
            self._progress = Progress(*columns(), console=Console(stderr=True), refresh_per_second=4, expand=True)
            self._task = self._progress.add_task("training", total=total, completed=done, figures="")
            self._progress.start()

    def stop(self) -> None:
        """Leave the terminal as it is."""
        if self._progress:
            self._progress.stop()

    def update(self, done: int, figures: str) -> None:
        """Show `done` iterations and the last figures; cheap enough for every iteration."""
        if self._progress and done % REFRESH == 0:
            self._progress.update(self._task, completed=done, figures=figures)


class Scalars:
    """Writes to out/tensorboard, or nowhere if not `enabled`."""

    def __init__(self, out: Path, enabled: bool, start: int) -> None:
        self._writer = None
        if enabled:
            from torch.utils.tensorboard import SummaryWriter  # slow to import

            # what a killed run wrote beyond its last checkpoint is drawn anew
            self._writer = SummaryWriter(str(Path(out) / "tensorboard"), purge_step=start if start else None)

    def add(self, values: dict[str, float], iteration: int) -> None:
        """Numbers by tag."""
        if self._writer:
            for name, value in values.items():
                self._writer.add_scalar(name, value, iteration)

    def add_pictures(self, pictures: dict[str, Any], iteration: int) -> None:
        """Pictures: (H, W, 3) uint8 by name."""
        if self._writer:
            for name, picture in pictures.items():
                self._writer.add_image(name, picture, iteration, dataformats="HWC")

    def close(self) -> None:
        """Write what is left."""
        if self._writer:
            self._writer.close()
