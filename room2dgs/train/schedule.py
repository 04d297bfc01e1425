"""Everything that depends on the iteration number alone. Iterations count from 0."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from room2dgs.config import RatesConfig, RenderConfig, ResolutionConfig, TermConfig

REST_SHARE = 1 / 20  # of the colour's rate, for SH above degree 0 (2DGS)
EXTENT_MIN_M = 0.1  # cameras that only turn have no extent, and nothing would move


def center_rate(iteration: int, iterations: int, rates: RatesConfig, extent_m: float) -> float:
    """Metres a step: extent x (center -> center_final), exponentially; the last iteration has the latter.

    Args:
        extent_m: `Scene.extent`; taken as at least 0.1 m.
    """
    if rates.center <= 0:
        return 0.0
    share = min(1.0, iteration / max(1, iterations - 1))
    return max(extent_m, EXTENT_MIN_M) * rates.center * (rates.center_final / rates.center) ** share


def learning_rates(iteration: int, iterations: int, rates: RatesConfig, extent_m: float) -> dict[str, float]:
    """Adam's rate for each parameter of the explicit decoder, by name."""
    return {
        "offsets": center_rate(iteration, iterations, rates, extent_m),
        "rotations": rates.rotation,
        "log_scales": rates.scale,
        "opacity_logits": rates.opacity,
        "sh_dc": rates.color,
        "sh_rest": rates.color * REST_SHARE,
    }


def active_sh_degree(iteration: int, render: RenderConfig) -> int:
    """0 at the start, one more every `sh_every` iterations, up to `sh_degree`."""
    return min(render.sh_degree, iteration // render.sh_every)


def image_fraction(iteration: int, resolutions: list[ResolutionConfig]) -> float:
    """Of the full image size: the first level whose `until` is still ahead, 1 after the last."""
    return next((level.fraction for level in resolutions if iteration < level.until), 1.0)


def is_active(iteration: int, term: TermConfig) -> bool:
    """Does this loss term act?"""
    return term.enabled and term.weight > 0 and iteration >= term.start


def view_index(iteration: int, views: int, seed: int) -> int:
    """Which training view: a new permutation of all views every epoch.

    It depends on the arguments alone, so a resumed run needs no state to go on in the same order.
    """
    epoch, place = divmod(iteration, views)
    return int(_permutation(epoch, views, seed)[place])


@lru_cache(maxsize=2)
def _permutation(epoch: int, views: int, seed: int) -> np.ndarray:
    return np.random.default_rng([seed % 2**63, epoch]).permutation(views)
