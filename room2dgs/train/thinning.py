"""No more surfels than the photos need: once growth has ended, those that hardly show in any of them go."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.splat.contribution import contributions, least_needed
from room2dgs.train.model import Model
from room2dgs.train.schedule import at_iteration, image_fraction
from room2dgs.train.step import current_splats
from room2dgs.train.strategies.ops import edit_rows, separate_rows
from room2dgs.train.trainer import Hook, Iteration, Trainer


class Thinning(Hook):
    """At `strategy.stop`, drops the surfels that together have `strategy.thin` of all that the training views show.

    A surfel is one of several that its seed has; those that are left are a seed each from then on, where the decoder
    can separate them. The shared decoder's go by whole seeds.
    """

    name = "thinning"

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        config = trainer.config
        if iteration.done != at_iteration(config.strategy.stop, config.train.iterations):
            return
        before, seeds = trainer.model.count, trainer.model.seeds
        needed = _contributions(trainer, image_fraction(iteration.number, config.train, trainer.views.widest))
        _drop_least(trainer.model, config.strategy.thin, needed)
        trainer.log(
            f"iteration {iteration.done}: {trainer.model.count:,} of {before:,} {trainer.model.primitive.called} of "
            f"{seeds:,} seeds "
            f"hold {100 * (1 - config.strategy.thin):g} % of what the views show; the others go"
        )
        trainer.clock.lap("strategy")


def _contributions(trainer: Trainer, fraction: float) -> Tensor:
    """(N,) float64: what each surfel adds to the training view that shows most of it."""
    views = (trainer.views.at(index, fraction, priors=False) for index in range(len(trainer.views)))
    sized = ((view.K, view.cam_from_world.detach(), view.width, view.height) for view in views)
    splats, near_m = current_splats(trainer.model, trainer.config.render), trainer.config.render.near_m
    return contributions(splats, sized, near_m, trainer.model.primitive.render)


def _drop_least(model: Model, share: float, needed: Tensor) -> None:
    separate = separate_rows(model)
    dropped = least_needed(needed if separate else needed.view(model.seeds, -1).sum(dim=1), share)
    if not bool(dropped.all()):
        edit_rows(model, torch.nonzero(~dropped)[:, 0])
