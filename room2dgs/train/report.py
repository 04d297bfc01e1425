"""Figures of a run to whoever watches: log lines, a bar on a terminal, tensorboard."""

from __future__ import annotations

import time

from room2dgs.train.progress import Bar, Means, Scalars
from room2dgs.train.step import psnr_db
from room2dgs.train.trainer import Hook, Iteration, Trainer

PSNR_EVERY = 10  # iterations; it is for the eye, and reads a whole image


class Report(Hook):
    """Collects figures of iterations and gives their means every `train.log_every`.

    Attributes:
        losses: the last logged means: each unweighted loss term, "loss", "psnr_db".
        test_psnr_db: the last held-out PSNR, None before the first.
    """

    def __init__(self, bar: bool = True) -> None:
        self._with_bar = bar
        self.losses: dict[str, float] = {}
        self.test_psnr_db: float | None = None

    def on_start(self, trainer: Trainer) -> None:
        self._config, self._log = trainer.config.train, trainer.log
        start = trainer.model.iteration
        self._bar = Bar(self._config.iterations, start, self._with_bar)
        self._scalars = Scalars(trainer.out, self._config.tensorboard, start)
        self._means = Means()
        self._figures = ""
        self._since = (time.perf_counter(), start)

    def on_end(self, trainer: Trainer) -> None:
        self._bar.stop()
        self._scalars.close()

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        done, step, surfels = iteration.done, iteration.step, trainer.model.count
        where = f"iteration {done}/{self._config.iterations}"
        self._means.add(step.losses)
        if done % PSNR_EVERY == 0 or trainer.finished:
            self._means.add({"psnr_db": psnr_db(step.color, step.target)})
        if done % self._config.log_every == 0 or trainer.finished:
            self.losses = self._means.pop()
            self._figures = self._line(done, f"{surfels} {trainer.model.primitive.called}")
            self._log(f"{where}: {self._figures}")
            self._scalars.add({f"train/{name}": value for name, value in self.losses.items()}, done)
            self._scalars.add({"train/surfels": float(surfels)}, done)
        self._bar.update(done, self._figures)
        if iteration.adjustment:
            seeds = trainer.model.seeds
            self._log(f"{where}: {iteration.adjustment.line()}; {seeds} seeds")
            self._scalars.add(iteration.adjustment.scalars() | {"seeds/count": float(seeds)}, done)
        if iteration.held_out_psnr_db is not None:
            self.test_psnr_db = iteration.held_out_psnr_db
            self._log(f"{where}: held-out PSNR {self.test_psnr_db:.2f} dB")
            self._scalars.add({"test/psnr_db": self.test_psnr_db}, done)

    def _line(self, done: int, surfels: str) -> str:
        now = time.perf_counter()
        rate = (done - self._since[1]) / max(now - self._since[0], 1e-9)
        self._since = (now, done)
        left = (self._config.iterations - done) / rate
        names = [name for name in self.losses if name not in ("loss", "psnr_db")]
        terms = ", ".join(f"{name} {self.losses[name]:.4f}" for name in names)
        psnr = f", PSNR {self.losses['psnr_db']:.2f} dB" if "psnr_db" in self.losses else ""
        return f"loss {self.losses['loss']:.4f} ({terms}){psnr}, {surfels}, {rate:.1f} it/s, {left / 60:.1f} min left"
