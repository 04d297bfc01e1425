"""The hooks of every run, beside its report: neighbours, densification, held-out views, checkpoints."""

from __future__ import annotations

from pathlib import Path

from torch import Tensor

from room2dgs.train import checkpoint
from room2dgs.train.neighbour_views import NeighbourViews
from room2dgs.train.step import mean_psnr_db
from room2dgs.train.strategies.strategy import Strategy
from room2dgs.train.trainer import Hook, Iteration, Trainer
from room2dgs.train.views import Views


class Neighbours(Hook):
    """Gives each iteration a neighbour for its multi-view terms and keeps what later ones compare with."""

    name = "multiview"

    def on_start(self, trainer: Trainer) -> None:
        self._views = NeighbourViews(trainer.views, trainer.config)

    def load(self, trainer: Trainer, state: dict[str, Tensor]) -> None:
        self._views.load(state)

    def before_iteration(self, trainer: Trainer, iteration: Iteration) -> None:
        iteration.pair = self._views.pair(iteration.number, iteration.view_index)

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        self._views.keep(iteration.number, iteration.view_index, iteration.step.depth, iteration.step.alpha)

    def state(self) -> dict[str, Tensor]:
        return self._views.state()


class Densification(Hook):
    """Adds and prunes seeds as a strategy decides; `Iteration.adjustment` says what it did."""

    name = "strategy"

    def __init__(self, strategy: Strategy) -> None:
        self._strategy = strategy

    def load(self, trainer: Trainer, state: dict[str, Tensor]) -> None:
        self._strategy.load(state)

    def before_iteration(self, trainer: Trainer, iteration: Iteration) -> None:
        iteration.screen_gradients = self._strategy.before_backward(iteration.number)

    def after_backward(self, trainer: Trainer, iteration: Iteration) -> None:
        self._strategy.add_gradients(trainer.model)

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        if iteration.screen_gradients:
            self._strategy.after_backward(iteration.step)
        iteration.adjustment = self._strategy.after_step(trainer.model)
        trainer.clock.lap("strategy")

    def state(self) -> dict[str, Tensor]:
        return self._strategy.state()


class HeldOut(Hook):
    """Renders the held-out views every `train.test_every` iterations and after the last one."""

    def on_start(self, trainer: Trainer) -> None:
        self._views = Views(trainer.scene.test, cache=trainer.scene.cache, on_device=trainer.views.on_device)

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        every = trainer.config.train.test_every
        if every and len(self._views) and (iteration.done % every == 0 or trainer.finished):
            iteration.held_out_psnr_db = mean_psnr_db(trainer.model, self._views, trainer.config.render)


class Checkpoints(Hook):
    """Saves the run every `train.checkpoint_every` iterations and after the last one; the last of the hooks."""

    def on_start(self, trainer: Trainer) -> None:
        # a run from the beginning takes the place of an earlier one, once it has a checkpoint of its own
        done = trainer.model.iteration
        self._on_disk: list[Path] = checkpoint.up_to(trainer.out, done) if done else []

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        settings = trainer.config.train
        if iteration.done % settings.checkpoint_every == 0 or trainer.finished:
            self._on_disk.append(checkpoint.save(trainer.out, trainer.checkpoint()))
            self._on_disk = self._on_disk[-settings.keep_checkpoints :]
            checkpoint.keep_only(trainer.out, self._on_disk)
