"""Densification of plain 2DGS (as 3DGS has it): the baseline without a seed's guidance, under the same trainer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from room2dgs.config import Config
from room2dgs.geometry.rotations import tangents
from room2dgs.primitives.activations import opacity_logit_of, scale_activation
from room2dgs.splat.types import Surfels
from room2dgs.train.model import Model
from room2dgs.train.schedule import EXTENT_MIN_M, at_iteration
from room2dgs.train.step import Step
from room2dgs.train.strategies.base import Adjustment, Strategy, window_of
from room2dgs.train.strategies.edit_seeds import edit_seeds
from room2dgs.train.strategies.screen_gradients import ScreenGradients

CHILDREN = 2  # of a split surfel
SHRINK = 0.8 * CHILDREN  # of their scales
RESET_OPACITY = 0.01


class PlainStrategy(Strategy):
    """Every seed is one surfel; one with a large screen-space gradient is cloned if small and split if large.

    Faint surfels are pruned at each adjustment, and oversized ones too once opacities have been reset. A clone is
    the same surfel again with no momentum, which is what parts the two. A child of a split keeps its parent's
    seed: the seed only holds the offset's origin here.

    Args:
        config: of the run; seeds.per_seed is 1 and the decoder explicit.
        extent_m: `Scene.extent`, the unit of the size limits.
    """

    def __init__(self, config: Config, extent_m: float) -> None:
        self._config = config
        self._extent_m = max(extent_m, EXTENT_MIN_M)
        self._window = window_of(config.strategy, config.train.iterations)
        self._reset_every = at_iteration(config.strategy.reset_every, config.train.iterations)
        self._gradients: ScreenGradients | None = None

    def before_backward(self, iteration: int) -> bool:
        return self._window.gathers(iteration)

    def after_backward(self, step: Step) -> None:
        if self._gradients is None:
            self._gradients = ScreenGradients(len(step.opacities), step.opacities.device)
        height, width = step.color.shape[:2]
        self._gradients.add(step.center_gradients, width, height)

    def after_step(self, model: Model) -> Adjustment | None:
        adjustment = None
        if self._gradients is not None and self._window.due(model.iteration):
            adjustment = self._adjust(model)
            self._gradients = ScreenGradients(model.surfel_count, self._gradients.sums.device)
        if self._resets(model.iteration):
            _reset_opacities(model)
            adjustment = replace(adjustment or Adjustment(), reset=True)
        return adjustment

    def state(self) -> dict[str, Tensor]:
        return {} if self._gradients is None else self._gradients.state()

    def load(self, state: dict[str, Tensor]) -> None:
        if state:
            self._gradients = ScreenGradients.of(state)

    def _resets(self, done: int) -> bool:
        every = self._reset_every
        return every > 0 and done % every == 0 and self._window.first <= done < self._window.last

    def _adjust(self, model: Model) -> Adjustment:
        strategy = self._config.strategy
        surfels = Surfels(*(values.detach() for values in model.surfels(0)))
        size = surfels.scales.amax(dim=1)
        faint = surfels.opacities < strategy.prune_opacity
        was_reset = 0 < self._reset_every < model.iteration
        large = ~faint & (size > strategy.prune_size * self._extent_m) if was_reset else torch.zeros_like(faint)
        pruned = faint | large
        if pruned.all():
            return Adjustment()

        means = self._gradients.means()
        growing = (means >= strategy.grow_gradient) & ~pruned
        growing = self._within_cap(growing, means, len(means) - int(pruned.sum()))
        to_split = growing & (size > strategy.split_size * self._extent_m)
        clones, parents = (growing & ~to_split).nonzero()[:, 0], to_split.nonzero()[:, 0]
        rows = {
            name: torch.cat([cloned, split])
            for (name, cloned), split in zip(
                _rows(model, clones).items(), self._children(model, surfels, parents).values(), strict=True
            )
        }
        edit_seeds(model, self._config.seeds, (~(pruned | to_split)).nonzero()[:, 0], rows)
        return Adjustment(
            added={"cloned": len(clones), "split": len(parents)},
            pruned={"faint": int(faint.sum()), "large": int(large.sum())},
        )

    def _within_cap(self, growing: Tensor, means: Tensor, survivors: int) -> Tensor:
        """The largest gradients first; a clone adds one surfel, and so does a split."""
        cap = self._config.strategy.max_surfels
        room = int(growing.sum()) if cap is None else max(0, cap - survivors)
        if room >= int(growing.sum()):
            return growing
        order = torch.sort(torch.where(growing, means, -1.0), descending=True, stable=True).indices
        chosen = torch.zeros_like(growing)
        chosen[order[:room]] = True
        return chosen

    def _children(self, model: Model, surfels: Surfels, parents: Tensor) -> dict[str, Tensor]:
        """Rows of two smaller surfels for each parent, drawn from its Gaussian, in its plane."""
        parents = parents.repeat_interleave(CHILDREN)
        rows = _rows(model, parents)
        draws = np.random.default_rng([self._config.train.seed % 2**63, model.iteration, 0x9117])
        steps = torch.from_numpy(draws.standard_normal((len(parents), 2), dtype=np.float32)).to(parents.device)
        in_plane = (steps * surfels.scales[parents]).unsqueeze(2) * tangents(surfels.rotations[parents])
        rows["offsets"] += in_plane.sum(dim=1, keepdim=True)
        rows["raw_scales"] = scale_activation(self._config.seeds).raw_of(surfels.scales[parents, None] / SHRINK)
        return rows


def _rows(model: Model, index: Tensor) -> dict[str, Tensor]:
    """Copies of some seeds' tensors, by name."""
    return {name: value.detach()[index] for name, value in (model.decoder.fixed() | model.decoder.parameters()).items()}


def _reset_opacities(model: Model) -> None:
    """No surfel more opaque than 0.01; those must earn it anew, with no momentum."""
    logits = model.decoder.parameters()["opacity_logits"]
    with torch.no_grad():
        logits.clamp_(max=opacity_logit_of(torch.tensor(RESET_OPACITY, dtype=logits.dtype)).item())
    for name in ("exp_avg", "exp_avg_sq"):
        if name in model.adam.state[logits]:
            model.adam.state[logits][name].zero_()
