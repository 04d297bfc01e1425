"""The paper's seed-guided optimisation: gradient-guided growth and contribution-based pruning (Sec. III-B)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.primitives.primitive import base_colors, mapped
from room2dgs.seeds.grow import Growth, Parents, grow
from room2dgs.seeds.hierarchy import level_edge
from room2dgs.seeds.prune import transparent, unseen
from room2dgs.seeds.spawn import first_opacity, spawn
from room2dgs.train.model import Model
from room2dgs.train.step import Step
from room2dgs.train.strategies.ops import edit_rows
from room2dgs.train.strategies.screen_gradients import ScreenGradients
from room2dgs.train.strategies.strategy import Adjustment, Strategy, window_of


class SeedStrategy(Strategy):
    """Seeds are pruned if transparent or seen by no view, and added in cells of a voxel hierarchy.

    Args:
        config: of the run.
        views: number of training views.
    """

    def __init__(self, config: Config, views: int) -> None:
        self._config = config
        self._views = views
        self._window = window_of(config.strategy, config.train.iterations)
        self._gradients: ScreenGradients | None = None
        self._opacities = torch.zeros(0, dtype=torch.float32)  # (N,) summed over the iterations
        self._gathered = 0  # iterations
        self._unseen = torch.zeros(0, dtype=torch.float32)  # (S,) iterations in a row, up to the last adjustment

    def before_backward(self, iteration: int) -> bool:
        return self._window.gathers(iteration)

    def after_backward(self, step: Step) -> None:
        assert step.opacities is not None and step.center_gradients is not None  # as `before_backward` asked
        if self._gradients is None:
            self._gradients = self._start(len(step.opacities), step.opacities.device)
        height, width = step.color.shape[:2]
        self._gradients.add(step.center_gradients, width, height)
        self._opacities = self._opacities.to(step.opacities.device)  # from a checkpoint
        self._opacities += step.opacities
        self._gathered += 1

    def after_step(self, model: Model) -> Adjustment | None:
        gradients = self._gradients
        if gradients is None or not self._window.due(model.iteration):
            return None
        keep, pruned = self._survivors(model.seeds, gradients)
        growth = self._growth(model, keep, gradients)
        settings = self._config.seeds
        rows = None
        if len(growth):
            draw = np.random.SeedSequence([self._config.train.seed % 2**63, model.iteration]).generate_state(1)[0]
            spawned = spawn(growth.seeds, settings.per_seed, first_opacity(self._config), int(draw))
            rows = model.decoder.rows_of(spawned, growth.family)
        if len(growth) or len(keep) < model.seeds:
            edit_rows(model, keep, rows)
        self._unseen = torch.cat([self._unseen[keep], torch.zeros(len(growth), dtype=torch.float32)])
        self._gradients = self._start(model.count, self._opacities.device)
        levels = self._config.strategy.levels
        edges = [level_edge(settings.voxel_m, level, levels) for level in range(levels)]
        added = {f"{100 * edge:g} cm": int((growth.level == level).sum()) for level, edge in enumerate(edges)}
        return Adjustment(added, pruned)

    def state(self) -> dict[str, Tensor]:
        if self._gradients is None:
            return {}
        gathered = torch.tensor(self._gathered)
        own = {"opacity_sums": self._opacities, "unseen": self._unseen, "gathered": gathered}
        return self._gradients.state() | own

    def load(self, state: dict[str, Tensor]) -> None:
        if state:
            self._gradients = ScreenGradients.of(state)
            self._opacities, self._unseen = state["opacity_sums"].clone(), state["unseen"].clone()
            self._gathered = int(state["gathered"])

    def _start(self, count: int, device: torch.device) -> ScreenGradients:
        """Gather anew, for so many primitives."""
        self._opacities = torch.zeros(count, dtype=torch.float32, device=device)
        self._gathered = 0
        return ScreenGradients(count, device)

    def _survivors(self, seeds: int, gradients: ScreenGradients) -> tuple[Tensor, dict[str, int]]:
        """Rows to keep, and how many are pruned for which reason; one seed at least stays."""
        if len(self._unseen) != seeds:
            self._unseen = torch.zeros(seeds, dtype=torch.float32)
        seen = gradients.visits.cpu().view(seeds, -1).amax(dim=1) > 0
        self._unseen = torch.where(seen, 0.0, self._unseen + self._gathered)
        opacities = (self._opacities / self._gathered).view(seeds, -1).cpu().numpy()
        faint = transparent(opacities, self._config.strategy.prune_opacity)
        hidden = unseen(self._unseen.numpy(), self._views) & ~faint
        keep = np.flatnonzero(~(faint | hidden))
        if len(keep) == 0:
            return torch.arange(seeds), {"transparent": 0, "unseen": 0}
        return torch.from_numpy(keep), {"transparent": int(faint.sum()), "unseen": int(hidden.sum())}

    def _growth(self, model: Model, keep: Tensor, gradients: ScreenGradients) -> Growth:
        """New seeds from the survivors' gradients; their parents' indices are those before the pruning."""
        settings, strategy = self._config.seeds, self._config.strategy
        splats = mapped(model.splats(0), lambda values: values.detach().cpu())
        seeds = model.decoder.fixed()["positions"].cpu()
        kept = torch.zeros(len(seeds), dtype=torch.bool)
        kept[keep] = True
        of_kept = kept.repeat_interleave(settings.per_seed)
        parents = Parents(
            seeds=seeds[keep].numpy().astype(np.float64),
            centres=splats.centers.numpy().astype(np.float64),
            normals=model.primitive.normals(splats).numpy(),
            scales=model.primitive.footprints(splats).numpy(),
            rgb=base_colors(splats).numpy(),
            gradients=gradients.means().cpu().numpy(),
            known=(of_kept & (gradients.visits.cpu() >= strategy.min_visits)).numpy(),
        )
        draws = np.random.default_rng([self._config.train.seed % 2**63, model.iteration, 0x6120])
        growth = grow(
            parents,
            settings.voxel_m,
            strategy.levels,
            strategy.grow_gradient,
            settings.max_scale_m,
            settings.per_seed,
            draws if strategy.random_survival else None,
        )
        if strategy.max_surfels is None:
            return growth
        return growth.largest(max(0, strategy.max_surfels // settings.per_seed - len(keep)))


def seed_strategy(config: Config, scene: Scene) -> SeedStrategy:
    """strategy.name=seeds."""
    return SeedStrategy(config, len(scene.train))
