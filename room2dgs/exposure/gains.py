"""How much brighter each photo is than the others, of each colour."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

ROUNDS = 12
SAME = 0.02  # deviation of the logarithms below which observations count as equal
LIKELY = 0.3  # deviation of a photo's logarithm before anything is known; cameras change by more than that seldom
CUT = 2.4  # deviations at which Cauchy's weight is a half (95 % efficient on normal errors)
ITERATIONS, SMALL = 200, 1e-10  # of the conjugate gradients; what is left of the residual


class Observed(NamedTuple):
    """Colours of places in photos, O of them.

    Attributes:
        view, place: (O,) int, which photo and which place.
        color: (O, 3) float, levels above 0.
        weight: (O, 3) float, 0 where the colour says nothing.
    """

    view: np.ndarray
    place: np.ndarray
    color: np.ndarray
    weight: np.ndarray


class Gains(NamedTuple):
    """Factors of the levels of V photos.

    Attributes:
        log: (V, 3) float64 logarithms of the factors; their mean over the photos is 0.
        error: (V, 3) float64 expected errors of the logarithms.
        noise: (3,) deviation of the observations' logarithms from what the gains say.
        places: (V,) how many places tie each photo to others, of the colour with the fewest.
    """

    log: np.ndarray
    error: np.ndarray
    noise: np.ndarray
    places: np.ndarray


def estimated_gains(seen: Observed, views: int) -> Gains:
    """The gains that best explain the observations: level = gain of the photo times colour of the place.

    Least squares of logarithms, reweighted by Cauchy's function of the residuals, so that wrong tracks, highlights and
    mirrors count little; photos that few places tie to others stay near the mean. The same bits on any number of
    threads: no sum is one of a threaded library.

    Args:
        views: number of photos; some may have no observation.
    """
    log, error, places = np.zeros((3, views, 3))
    noise = np.zeros(3)
    for channel in range(3):
        used = np.flatnonzero(seen.weight[:, channel] > 0)
        shared = np.bincount(seen.place[used])[seen.place[used]] > 1
        used = used[shared]
        places[:, channel] = np.bincount(seen.view[used], minlength=views)
        if len(used):
            values = np.log(seen.color[used, channel].astype(np.float64))
            ties = seen.view[used], seen.place[used], values, seen.weight[used, channel].astype(np.float64)
            log[:, channel], error[:, channel], noise[channel] = _one_channel(*ties, views)
    return Gains(log, error, noise, places.min(axis=1))


def _one_channel(
    view: np.ndarray, place: np.ndarray, value: np.ndarray, given: np.ndarray, views: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """(V,) gains, (V,) their errors, and the noise."""
    places = int(place.max()) + 1
    gain = np.zeros(views)
    noise, weight = np.inf, given
    for number in range(ROUNDS):
        gain = solved(gain, view, place, value, weight, (views, places), _prior(noise, number))
        level = means(place, value - gain[view], weight, places)
        left = np.abs(value - gain[view] - level[place])
        noise = max(_middle(left, given) / 0.6745, SAME / 4)
        weight = given / (1 + (left / (CUT * noise)) ** 2)
    amount = np.bincount(view, weight, views) + _prior(noise, ROUNDS)
    return gain, noise / np.sqrt(amount), float(noise)


def _prior(noise: float, number: int) -> float:
    """Weight of the gain 1 of each photo, in observations."""
    return 1e-3 if number == 0 else (noise / LIKELY) ** 2


def solved(
    start: np.ndarray,
    view: np.ndarray,
    place: np.ndarray,
    value: np.ndarray,
    weight: np.ndarray,
    shape: tuple[int, int],
    prior: float,
) -> np.ndarray:
    """(V,) the gains of mean 0 of weighted least squares, with the places' colours taken out (Schur complement).

    Args:
        start: (V,) to begin with.
        view, place, value, weight: (O,) of each observation: value = gain of its view + level of its place.
        shape: number of views and of places.
        prior: weight of the gain 0 of each view, in observations.
    """
    ties = sparse.csr_matrix((weight, (view, place)), shape=shape)
    turned = ties.T.tocsr()
    of_view, of_place = np.bincount(view, weight, shape[0]), np.bincount(place, weight, shape[1])
    share = np.divide(1.0, of_place, out=np.zeros_like(of_place), where=of_place > 0)
    right = np.bincount(view, weight * value, shape[0])
    right -= ties @ (share * np.bincount(place, weight * value, shape[1]))

    def times(gain: np.ndarray) -> np.ndarray:
        return (of_view + prior) * gain - ties @ (share * (turned @ gain))

    gain = _conjugate_gradients(times, right, start, of_view + prior)
    return gain - gain.mean()


def _conjugate_gradients(times, right: np.ndarray, start: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    found = start.copy()
    left = right - times(found)
    step = left / diagonal
    size = _dot(left, step)
    enough = SMALL * max(_dot(right, right / diagonal), 1e-30)
    for _ in range(ITERATIONS):
        if size <= enough:
            break
        along = times(step)
        far = size / _dot(step, along)
        found += far * step
        left = left - far * along
        ahead = left / diagonal
        size, before = _dot(left, ahead), size
        step = ahead + size / before * step
    return found


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    """Not BLAS's, whose order of summing may follow the threads."""
    return float((a * b).sum())


def means(group: np.ndarray, values: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
    """(count,) weighted means; 0 of an empty group."""
    total = np.bincount(group, weight, count)
    return np.divide(np.bincount(group, weight * values, count), total, out=np.zeros(count), where=total > 0)


def _middle(values: np.ndarray, weight: np.ndarray) -> float:
    """The weighted median."""
    order = np.argsort(values, kind="stable")
    along = np.cumsum(weight[order])
    return float(values[order[np.searchsorted(along, along[-1] / 2)]])
