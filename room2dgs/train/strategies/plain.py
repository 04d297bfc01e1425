"""Densification of plain 2DGS (as 3DGS has it): the baseline without growth on a grid, under the same trainer."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.primitives.activations import opacity_logit_of
from room2dgs.primitives.primitive import OPACITY_LOGITS, Splats, mapped
from room2dgs.train.model import Model
from room2dgs.train.schedule import EXTENT_MIN_M, at_iteration
from room2dgs.train.step import Step
from room2dgs.train.strategies.ops import cap_parameter, copied_rows, edit_rows, joined_rows
from room2dgs.train.strategies.screen_gradients import ScreenGradients
from room2dgs.train.strategies.strategy import Adjustment, Strategy, Window, window_of

CHILDREN = 2  # of a split primitive
SHRINK = 0.8 * CHILDREN  # of their scales
RESET_OPACITY = 0.01
# Of all training photos together, for one primitive: some ten photos see a place, so each has two pixels of theirs. The
# thresholds of 3DGS alone stop growth at a share of the picture, which in small photos is less than a pixel.
PIXELS_EACH = 16


class PlainStrategy(Strategy):
    """Every row is one primitive; one with a large screen-space gradient is cloned if small and split if large.

    Faint surfels are pruned at each adjustment, and oversized ones too once opacities have been reset. A clone is
    the same primitive again with no momentum, which is what parts the two.

    Args:
        config: of the run; seeds.per_seed is 1 and the decoder explicit.
        extent_m: `Scene.extent`, the unit of the size limits.
        pixels: of all training photos, which bound growth where the settings do not.
    """

    def __init__(self, config: Config, extent_m: float, pixels: int) -> None:
        self._config = config
        most = config.strategy.max_surfels
        self._most = pixels // PIXELS_EACH if most is None else most
        self._extent_m = max(extent_m, EXTENT_MIN_M)
        self._window = window_of(config.strategy, config.train.iterations)
        self._resets = resets(self._window, at_iteration(config.strategy.reset_every, config.train.iterations))
        self._gradients: ScreenGradients | None = None

    def before_backward(self, iteration: int) -> bool:
        return self._window.gathers(iteration)

    def after_backward(self, step: Step) -> None:
        assert step.opacities is not None and step.center_gradients is not None  # as `before_backward` asked
        if self._gradients is None:
            self._gradients = ScreenGradients(len(step.opacities), step.opacities.device)
        height, width = step.color.shape[:2]
        self._gradients.add(step.center_gradients, width, height)

    def after_step(self, model: Model) -> Adjustment | None:
        adjustment = None
        if self._gradients is not None and self._window.due(model.iteration):
            adjustment = self._adjust(model, self._gradients.means())
            self._gradients = ScreenGradients(model.count, self._gradients.sums.device)
        if model.iteration in self._resets:
            highest = opacity_logit_of(torch.tensor(RESET_OPACITY, dtype=torch.float32)).item()
            cap_parameter(model, OPACITY_LOGITS, highest)
            adjustment = replace(adjustment or Adjustment(), reset=True)
        return adjustment

    def state(self) -> dict[str, Tensor]:
        return {} if self._gradients is None else self._gradients.state()

    def load(self, state: dict[str, Tensor]) -> None:
        if state:
            self._gradients = ScreenGradients.of(state)

    def _adjust(self, model: Model, means: Tensor) -> Adjustment:
        strategy = self._config.strategy
        splats = mapped(model.splats(0), Tensor.detach)
        size = model.primitive.sizes(splats)
        faint = splats.opacities < strategy.prune_opacity
        was_reset = any(reset < model.iteration for reset in self._resets)
        large = ~faint & (size > strategy.prune_size * self._extent_m) if was_reset else torch.zeros_like(faint)
        pruned = faint | large
        if pruned.all():
            return Adjustment()

        growing = (means >= strategy.grow_gradient) & ~pruned
        growing = self._within_cap(growing, means, len(means) - int(pruned.sum()))
        to_split = growing & (size > strategy.split_size * self._extent_m)
        clones, parents = (growing & ~to_split).nonzero()[:, 0], to_split.nonzero()[:, 0]
        added = joined_rows(copied_rows(model, clones), self._children(model, splats, parents))
        edit_rows(model, (~(pruned | to_split)).nonzero()[:, 0], added)
        return Adjustment(
            added={"cloned": len(clones), "split": len(parents)},
            pruned={"faint": int(faint.sum()), "large": int(large.sum())},
        )

    def _within_cap(self, growing: Tensor, means: Tensor, survivors: int) -> Tensor:
        """The largest gradients first; a clone adds one primitive, and so does a split."""
        room = max(0, self._most - survivors)
        if room >= int(growing.sum()):
            return growing
        order = torch.sort(torch.where(growing, means, -1.0), descending=True, stable=True).indices
        chosen = torch.zeros_like(growing)
        chosen[order[:room]] = True
        return chosen

    def _children(self, model: Model, splats: Splats, parents: Tensor) -> dict[str, Tensor]:
        """Rows of two smaller primitives for each parent, drawn from its Gaussian."""
        parents = parents.repeat_interleave(CHILDREN)
        draws = np.random.default_rng([self._config.train.seed % 2**63, model.iteration, 0x9117])
        of_parents = mapped(splats, lambda values: values[parents])
        return model.primitive.children(copied_rows(model, parents), of_parents, draws, SHRINK)


def resets(window: Window, every: int) -> tuple[int, ...]:
    """After how many iterations opacities are reset: `every`, twice as many, ..., at the next adjustment.

    They have an interval to come back before the next one prunes what is faint, and growth goes on for another `every`
    iterations to make good what is lost: a run whose growth ends sooner has no reset.
    """
    wanted = range(every, window.last - every + 1, every) if every > 0 else ()
    steps = (max(0, math.ceil((done - window.first) / window.every)) for done in wanted)
    return tuple(sorted({window.first + step * window.every for step in steps}))


def plain_strategy(config: Config, scene: Scene) -> PlainStrategy:
    """strategy.name=plain."""
    cameras = [frame.camera for frame in scene.train]
    return PlainStrategy(config, scene.extent, sum(camera.width * camera.height for camera in cameras))
