"""Densification as sampling: transparent primitives move to where opaque ones are, and noise explores.

Kheradmand et al., "3D Gaussian Splatting as Markov Chain Monte Carlo", 2024.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.primitives.activations import opacity_logit_of
from room2dgs.primitives.primitive import OFFSETS, OPACITY_LOGITS, RAW_SCALES, Splats, mapped
from room2dgs.train.model import Model
from room2dgs.train.schedule import EXTENT_MIN_M, center_rate
from room2dgs.train.strategies.ops import Tensors, copied_rows, edit_rows, joined_rows
from room2dgs.train.strategies.strategy import Adjustment, Strategy, window_of

GROWTH = 1.05  # a step of growth, until `strategy.max_surfels`; more where that would not be there at half time
OPACITY_COST = SCALE_COST = 0.01  # of the mean opacity and of the mean scale (metres), added to the loss
NOISE = 5e5  # of the centres' learning rate, times the covariance, both for an extent of 1
STEEPNESS, TRANSPARENT = 100.0, 0.005  # noise acts on what is about as transparent as this
SHARED_MOST = 51  # primitives in one place, for which the table of binomials is made


class McmcStrategy(Strategy):
    """Every row is one primitive. Their number grows up to a cap by 5 % each time, or as fast as the cap wants.

    Those below `strategy.prune_opacity` move to where opaque ones are, and N in one place share opacity and size so
    that together they look as the one did (eq. 9 of the paper). Noise moves the transparent ones on at every
    iteration, and small costs keep opacities and scales down.

    Args:
        config: of the run; seeds.per_seed is 1 and the decoder explicit.
        extent_m: `Scene.extent`.
    """

    def __init__(self, config: Config, extent_m: float) -> None:
        self._config, self._extent_m = config, max(extent_m, EXTENT_MIN_M)
        self._window = window_of(config.strategy, config.train.iterations)

    def add_gradients(self, model: Model) -> None:
        splats = model.splats(0)
        total = OPACITY_COST * splats.opacities.mean() + SCALE_COST * splats.scales.mean()
        leaves = [model.decoder.parameters()[name] for name in (OPACITY_LOGITS, RAW_SCALES)]
        for leaf, gradient in zip(leaves, torch.autograd.grad(total, leaves), strict=True):
            leaf.grad = gradient if leaf.grad is None else leaf.grad.add_(gradient)

    def after_step(self, model: Model) -> Adjustment | None:
        adjustment = None
        if self._window.due(model.iteration):
            adjustment = self._adjust(model)
        if model.iteration <= self._window.last:
            self._move(model)
        return adjustment

    def _move(self, model: Model) -> None:
        """Noise along each primitive's axes, by its covariance, the more the more transparent it is."""
        train = self._config.train
        rate = center_rate(model.iteration - 1, train.iterations, train.rates, self._extent_m)
        draws = torch.Generator().manual_seed(_seed(train.seed, model.iteration, 0x4E01))
        with torch.no_grad():
            splats = model.splats(0)
            axes, scales = model.primitive.scale_axes(splats), model.primitive.axis_scales(splats)
            noise = torch.randn(splats.centers.shape, generator=draws).to(scales)
            along = (axes @ noise[:, :, None]).squeeze(2) * scales.square()
            share = torch.sigmoid(-STEEPNESS * (splats.opacities - TRANSPARENT))
            strength = NOISE * rate / self._extent_m**2
            shift = (along[:, None] @ axes).squeeze(1) * (strength * share)[:, None]
            model.decoder.parameters()[OFFSETS].add_(shift[:, None])

    def _adjust(self, model: Model) -> Adjustment:
        strategy = self._config.strategy
        splats = mapped(model.splats(0), Tensor.detach)
        dead = splats.opacities <= strategy.prune_opacity
        alive = (~dead).nonzero()[:, 0]
        if not len(alive):
            return Adjustment()
        cap = math.inf if strategy.max_surfels is None else strategy.max_surfels
        more = max(0, int(min(cap, self._growth(model) * model.count)) - model.count)
        draws = np.random.default_rng([self._config.train.seed % 2**63, model.iteration, 0x3C3C])
        weights = splats.opacities[alive].double().cpu().numpy()
        chosen = draws.choice(len(alive), int(dead.sum()) + more, p=weights / weights.sum())
        parents = alive[torch.from_numpy(chosen)]
        copies = torch.bincount(parents, minlength=model.count)
        shared = self._shared(model, splats, copies)
        rows = {**copied_rows(model, parents), **{name: values[parents] for name, values in shared.items()}}
        changed = (copies > 0).nonzero()[:, 0]
        keep = ((copies == 0) & ~dead).nonzero()[:, 0]
        kept_places = {**copied_rows(model, changed), **{name: values[changed] for name, values in shared.items()}}
        edit_rows(model, keep, joined_rows(kept_places, rows))
        return Adjustment(added={"sampled": more}, pruned={"moved": int(dead.sum())})

    def _growth(self, model: Model) -> float:
        """Factor of one step: a short run comes to its cap too, by the middle of the window."""
        window, cap = self._window, self._config.strategy.max_surfels
        middle = (window.first + window.last) / 2
        steps = max(1.0, (middle - model.iteration) / window.every)
        return GROWTH if cap is None else max(GROWTH, (cap / model.count) ** (1 / steps))

    def _shared(self, model: Model, splats: Splats, copies: Tensor) -> Tensors:
        """Raw opacities and scales of each primitive once `copies` more are where it is."""
        opacities, factors = shared_by(splats.opacities, copies + 1)
        return {
            OPACITY_LOGITS: opacity_logit_of(opacities.clamp(self._config.strategy.prune_opacity, 1 - 1e-6))[:, None],
            RAW_SCALES: model.primitive.activation.raw_of(splats.scales * factors[:, None])[:, None],
        }


def shared_by(opacities: Tensor, count: Tensor) -> tuple[Tensor, Tensor]:
    """Opacity and factor of the scales with which `count` primitives look together as one did (eq. 9).

    Args:
        opacities: (N,); count: (N,) int64, at least 1.
    """
    count = count.clamp(max=SHARED_MOST)
    each = 1 - (1 - opacities.double()) ** (1 / count.double())
    powers = each[:, None] ** torch.arange(1, SHARED_MOST + 1, device=each.device)
    total = (powers * _alternating().to(each)[count - 1]).sum(dim=1)
    return each.to(opacities), (opacities.double() / total).to(opacities)


@lru_cache(maxsize=1)
def _alternating() -> Tensor:
    """(n, k): sum over i <= n of binomial(i, k) (-1)^k / sqrt(k + 1), n and k from 0."""
    table = torch.zeros(SHARED_MOST, SHARED_MOST, dtype=torch.float64)
    for i in range(SHARED_MOST):
        for k in range(i + 1):
            table[i, k] = math.comb(i, k) * (-1) ** k / math.sqrt(k + 1)
    return table.cumsum(dim=0)


def _seed(seed: int, iteration: int, what: int) -> int:
    return int(np.random.SeedSequence([seed % 2**63, iteration, what]).generate_state(1)[0])


def mcmc_strategy(config: Config, scene: Scene) -> McmcStrategy:
    """strategy.name=mcmc."""
    return McmcStrategy(config, scene.extent)
