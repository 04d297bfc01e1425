"""Depth between the samples: the systems of all views, solved a few at a time."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Executor
from functools import partial
from itertools import islice

import numpy as np

from room2dgs.depth.completion.low_res import Completed, LowResInput
from room2dgs.depth.completion.solve import System, solved, system
from room2dgs.freed_memory import give_back

AT_ONCE = 16  # images, whose systems are in memory


def interpolated(inputs: Iterable[LowResInput], pool: Executor) -> list[Completed]:
    """Each view's depth from its own samples, prior and slopes (`solve`); the inputs may be made as they are needed."""
    found: list[Completed] = []
    rest = iter(inputs)
    while some := list(islice(rest, AT_ONCE)):
        scales = solved(list(pool.map(system_of, some)))
        found += [_at_scale(view, scale.astype(np.float32)) for view, scale in zip(some, scales, strict=True)]
    give_back()  # the systems of some images, again and again, between what is kept
    return found


def system_of(view: LowResInput) -> System:
    """One view's system, in double precision."""
    double = partial(np.asarray, dtype=np.float64)
    return system(
        double(view.sample),
        double(view.sample_weight),
        double(view.prior),
        double(view.prior_weight),
        (double(view.slopes[0]), double(view.slopes[1])),
        double(view.slope_weight),
        view.edges,
        by_normals=bool(view.normal.any()),
    )


def _at_scale(view: LowResInput, scale: np.ndarray) -> Completed:
    depth = (view.prior * np.exp(scale)).astype(np.float32)
    return Completed(view.camera, view.sample, view.sample_weight, scale, depth, np.zeros_like(depth))
