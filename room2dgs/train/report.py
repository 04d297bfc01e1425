"""Figures of a run to whoever watches: log lines, a bar on a terminal, tensorboard."""

from __future__ import annotations

import time
from pathlib import Path

from room2dgs.config import TrainConfig
from room2dgs.train.progress import Bar, Log
from room2dgs.train.scalars import Scalars
from room2dgs.train.statistics import Means, psnr_db
from room2dgs.train.step import Step
from room2dgs.train.strategies.base import Adjustment

PSNR_EVERY = 10  # iterations; it is for the eye, and reads a whole image


class Report:
    """Collects figures of iterations and gives their means every `log_every`; a context manager.

    Attributes:
        losses: the last logged means: each unweighted loss term, "loss", "psnr_db".
        test_psnr_db: the last held-out PSNR, None before the first.
    """

    def __init__(self, out: Path, config: TrainConfig, start: int, log: Log) -> None:
        self.losses: dict[str, float] = {}
        self.test_psnr_db: float | None = None
        self._config = config
        self._log = log
        self._bar = Bar(config.iterations, start)
        self._scalars = Scalars(out, config.tensorboard, start)
        self._means = Means()
        self._figures = ""
        self._since = (time.perf_counter(), start)

    def __enter__(self) -> Report:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
        self._scalars.close()

    def step(self, done: int, step: Step, surfels: int) -> None:
        """After each iteration; `done` counts it."""
        self._means.add(step.losses)
        if done % PSNR_EVERY == 0 or done == self._config.iterations:
            self._means.add({"psnr_db": psnr_db(step.color, step.target)})
        if done % self._config.log_every == 0 or done == self._config.iterations:
            self.losses = self._means.take()
            self._figures = self._line(done, surfels)
            self._log(f"iteration {done}/{self._config.iterations}: {self._figures}")
            self._scalars.add({f"train/{name}": value for name, value in self.losses.items()}, done)
            self._scalars.add({"train/surfels": float(surfels)}, done)
        self._bar.update(done, self._figures)

    def adjusted(self, done: int, adjustment: Adjustment, seeds: int) -> None:
        """After densification and pruning."""
        self._log(f"iteration {done}/{self._config.iterations}: {adjustment.line()}; {seeds} seeds")
        self._scalars.add(adjustment.scalars() | {"seeds/count": float(seeds)}, done)

    def test(self, done: int, psnr: float) -> None:
        """After the held-out views were rendered."""
        self.test_psnr_db = psnr
        self._log(f"iteration {done}/{self._config.iterations}: held-out PSNR {psnr:.2f} dB")
        self._scalars.add({"test/psnr_db": psnr}, done)

    def _line(self, done: int, surfels: int) -> str:
        now = time.perf_counter()
        rate = (done - self._since[1]) / max(now - self._since[0], 1e-9)
        self._since = (now, done)
        left = (self._config.iterations - done) / rate
        names = [name for name in self.losses if name not in ("loss", "psnr_db")]
        terms = ", ".join(f"{name} {self.losses[name]:.4f}" for name in names)
        psnr = f", PSNR {self.losses['psnr_db']:.2f} dB" if "psnr_db" in self.losses else ""
        return (
            f"loss {self.losses['loss']:.4f} ({terms}){psnr}, {surfels} surfels, "
            f"{rate:.1f} it/s, {left / 60:.1f} min left"
        )
