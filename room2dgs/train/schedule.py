"""Everything that depends on the iteration number alone. Iterations count from 0."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from room2dgs.config import Config, NormalReweightingConfig, RatesConfig, RenderConfig, TermConfig, TrainConfig
from room2dgs.primitives.primitive import Rates
from room2dgs.splat.constants import OPACITY_FLOOR

CORRECTIONS_START = 0.1  # of the run
EXTENT_MIN_M = 0.1  # cameras that only turn have no extent, and nothing would move


def center_rate(iteration: int, iterations: int, rates: RatesConfig, extent_m: float) -> float:
    """Metres a step: extent x (center -> center_final), exponentially; the last iteration has the latter.

    Args:
        extent_m: `Scene.extent`; taken as at least 0.1 m.
    """
    return max(extent_m, EXTENT_MIN_M) * _decayed(iteration, iterations, rates.center, rates.center_final)


def rates_at(iteration: int, iterations: int, rates: RatesConfig, extent_m: float) -> Rates:
    """Adam's learning rates; the decoder says which of them each parameter has.

    Args:
        extent_m: as of `center_rate`.
    """
    return Rates(
        center=center_rate(iteration, iterations, rates, extent_m),
        rotation=rates.rotation,
        scale=rates.scale,
        opacity=rates.opacity,
        color=rates.color,
        feature=rates.feature,
        network=_decayed(iteration, iterations, rates.network, rates.network_final),
    )


def correction_share(iteration: int, iterations: int) -> float:
    """Of the rates of poses' corrections: 0 until surfels have some shape, then 1, falling to 0.01."""
    start = round(CORRECTIONS_START * iterations)
    return 0.0 if iteration < start else _decayed(iteration - start, iterations - start, 1.0, 0.01)


def _decayed(iteration: int, iterations: int, first: float, final: float) -> float:
    """first -> final, exponentially; the last iteration has the latter."""
    if first <= 0:
        return 0.0
    share = min(1.0, iteration / max(1, iterations - 1))
    return first * (final / first) ** share


def active_sh_degree(iteration: int, render: RenderConfig) -> int:
    """0 at the start, one more every `sh_every` iterations, up to `sh_degree`."""
    return min(render.sh_degree, iteration // render.sh_every)


def image_fraction(iteration: int, train: TrainConfig, width: int) -> float:
    """Of the full image size: the first level whose `until` is still ahead, 1 after the last.

    Args:
        width: of the full photos, pixels; small ones are not made smaller than `train.coarsest_px`.
    """
    ahead = (level for level in train.resolutions if iteration < at_iteration(level.until, train.iterations))
    return next((max(level.fraction, min(1.0, train.coarsest_px / width)) for level in ahead), 1.0)


def opacity_floor(iteration: int, train: TrainConfig) -> float:
    """Below which hits are skipped: what other programs that draw surfels have, once `until` is reached."""
    early = iteration < at_iteration(train.opacity_floor.until, train.iterations)
    return train.opacity_floor.value if early else OPACITY_FLOOR


def at_iteration(time: int | float, iterations: int) -> int:
    """What a schedule's setting means in a run of `iterations`: an int is an iteration, a float a share of them.

    1 is iteration 1; 1.0 is `iterations`, the end of the run.
    """
    return round(time * iterations) if isinstance(time, float) else time


def term_weight(iteration: int, term: TermConfig, iterations: int) -> float:
    """Weight of a loss term: 0 outside start <= iteration < end, rising linearly over the first `ramp`.

    Args:
        iterations: of the whole run.
    """
    since = iteration - at_iteration(term.start, iterations)
    over = term.end is not None and iteration >= at_iteration(term.end, iterations)
    if not term.enabled or since < 0 or over:
        return 0.0
    ramp = at_iteration(term.ramp, iterations)
    return term.weight * min(1.0, (since + 1) / (ramp + 1))


def reweighting_deg(iteration: int, settings: NormalReweightingConfig, iterations: int) -> float | None:
    """The angle at which a prior normal's weight is a quarter; None: no normal is reweighted (yet).

    It narrows exponentially from the first such iteration to the last one of the run.
    """
    start = at_iteration(settings.start, iterations)
    if not settings.enabled or iteration < start:
        return None
    return _decayed(iteration - start, iterations - start, settings.first_deg, settings.last_deg)


def has_shares(config: Config) -> bool:
    """Is a time that matters to this run a share of `train.iterations`? Reweighting and corrections use all of them."""
    terms = [term for term in vars(config.loss).values() if isinstance(term, TermConfig) and term.enabled]
    times = [time for term in terms for time in (term.start, term.end, term.ramp)]
    times += [level.until for level in config.train.resolutions]
    times.append(config.train.opacity_floor.until)
    if config.strategy.name != "fixed" or config.strategy.thin > 0:
        times += [config.strategy.start, config.strategy.stop, config.strategy.reset_every]
    return (
        config.train.refine_poses
        or config.loss.normal_reweighting.enabled
        or any(isinstance(time, float) for time in times)
    )


def multiview_acts(iteration: int, config: Config) -> bool:
    """Does one of the two multi-view terms act in this iteration?"""
    terms = (config.loss.multiview_geometric, config.loss.multiview_photometric)
    return any(term_weight(iteration, term, config.train.iterations) > 0 for term in terms)


def view_index(iteration: int, views: int, seed: int) -> int:
    """Which training view: a new permutation of all views every epoch.

    It depends on the arguments alone, so a resumed run needs no state to go on in the same order.
    """
    epoch, place = divmod(iteration, views)
    return int(_permutation(epoch, views, seed)[place])


@lru_cache(maxsize=2)
def _permutation(epoch: int, views: int, seed: int) -> np.ndarray:
    return np.random.default_rng([seed % 2**63, epoch]).permutation(views)
