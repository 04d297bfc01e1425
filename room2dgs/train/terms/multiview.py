"""The multi-view terms of one rendering: drawn pixels compared with a neighbour."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs.config import MultiviewConfig
from room2dgs.losses.compared_pixels import Neighbour, Photo, multiview_losses
from room2dgs.splat.constants import MIN_COVERED_ALPHA
from room2dgs.splat.types import Rendering
from room2dgs.train.depth_cache import STEP
from room2dgs.train.device import upload
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.terms.term import LossTerm, TermContext
from room2dgs.train.views import View

GEOMETRIC, PHOTOMETRIC = "multiview_geometric", "multiview_photometric"
TRIES = 4  # pixels tried for each that is wanted


def multiview_terms(
    rendering: Rendering, view: View, pair: Pair, config: MultiviewConfig, names: list[str]
) -> dict[str, Tensor]:
    """Unweighted values of those of the two terms that are named; differentiable once in depth and normal.

    Compared are up to `config.samples` pixels, drawn among those whose patch has texture and whose ray the surfels
    stop. The neighbour's depth is that of its last rendering and gets no gradient.
    """
    neighbour = pair.neighbour
    normal = rendering.normal if PHOTOMETRIC in names else None
    values = multiview_losses(
        rendering.depth,
        normal,
        drawn_slots(rendering, pair, config.samples),
        Photo(pair.photo.grey, view.K, view.cam_from_world),
        Neighbour(
            Photo(pair.neighbour_photo.grey, neighbour.K, neighbour.cam_from_world),
            neighbour.mask,
            pair.inverse_depth,
            STEP,
        ),
        config.patch,
    )
    return {name: value for name, value in zip((GEOMETRIC, PHOTOMETRIC), values, strict=True) if name in names}


def _term(name: str, reads: tuple[str, ...] = ()) -> LossTerm:
    """Both terms have most of their work in common, so that those that act are computed together."""

    def value(rendering: Rendering, view: View, context: TermContext) -> Tensor:
        names = [name for name in (GEOMETRIC, PHOTOMETRIC) if name in context.active]
        settings, pair = context.config.loss.multiview, context.pair
        assert pair is not None  # `applies`
        values = context.shared("multiview", lambda: multiview_terms(rendering, view, pair, settings, names))
        return values[name]

    return LossTerm(value, reads, lambda view, pair: pair is not None, stage="multiview")


MULTIVIEW_GEOMETRIC = _term(GEOMETRIC)
MULTIVIEW_PHOTOMETRIC = _term(PHOTOMETRIC, reads=("normal",))


def drawn_slots(rendering: Rendering, pair: Pair, count: int) -> Tensor:
    """(count,) int32: row * width + column of the pixels to compare, then -1.

    The length does not depend on how many pixels there are: counting them would wait for the GPU.
    """
    height, width = rendering.depth.shape
    drawn = upload(tries(height * width, pair, count).int(), rendering.depth.device)
    alpha, depth = (values.detach().flatten()[drawn] for values in (rendering.alpha, rendering.depth))
    fits = pair.photo.textured.flatten()[drawn] & (alpha >= MIN_COVERED_ALPHA) & (depth > 0)
    slot = torch.where(fits, fits.cumsum(0) - 1, count).clamp(max=count)  # the last one takes all that is left over
    return drawn.new_full((count + 1,), -1).scatter_(0, slot, drawn)[:count]


def tries(pixels: int, pair: Pair, count: int) -> Tensor:
    """(4 count,) int64 of an image's pixels, drawn by the pair's seed."""
    return torch.from_numpy(np.random.default_rng(pair.seed).integers(pixels, size=TRIES * count))
