"""The multi-view terms of one rendering: drawn pixels compared with a neighbour."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from room2dgs.config import MultiviewConfig
from room2dgs.geometry.homography import relative_pose
from room2dgs.kernels.operators import has_kernels
from room2dgs.losses.compared_pixels import Neighbour, Photo, multiview_losses
from room2dgs.losses.multiview import (
    multiview_geometric,
    multiview_photometric,
    neighbour_patches,
    round_trip_error,
    round_trip_weight,
)
from room2dgs.losses.sampling import patches_at
from room2dgs.splat.constants import MIN_COVERED_ALPHA
from room2dgs.splat.types import Rendering
from room2dgs.train.depth_cache import STEP
from room2dgs.train.device import upload
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.terms.term import LossTerm, TermContext
from room2dgs.train.views import View

GEOMETRIC, PHOTOMETRIC = "multiview_geometric", "multiview_photometric"
TRIES = 4  # pixels tried for each that is wanted
WHOLE_SHARE = 1 - 1e-4  # of usable pixels around each sample of a patch; interpolation rounds
TINY = 1e-3  # rendered normals that cancel have no direction; their gradient stays below 1 / TINY


def multiview_terms(
    rendering: Rendering, view: View, pair: Pair, config: MultiviewConfig, names: list[str]
) -> dict[str, Tensor]:
    """Unweighted values of those of the two terms that are named; differentiable once in depth and normal.

    Compared are up to `config.samples` pixels, drawn among those whose patch has texture and whose ray the surfels
    stop. The neighbour's depth is that of its last rendering and gets no gradient. float32 takes the kernels that are
    written for a GPU; as plain C++ they are faster than torch's operators on the CPU, too.
    """
    if has_kernels(rendering.depth):
        return _by_kernels(rendering, view, pair, config, names)
    column, row = drawn_pixels(rendering, pair, config.samples)
    reference = patches_at(pair.photo.grey, column, row, config.patch)
    pixels = torch.stack([column, row], dim=-1) + 0.5
    pose = relative_pose(view.cam_from_world, pair.neighbour.cam_from_world)
    K, other_K = view.K, pair.neighbour.K

    def values(depth: Tensor, normal: Tensor) -> list[Tensor]:
        # the photometric term only weighs by it
        with torch.set_grad_enabled(GEOMETRIC in names):
            error, seen = round_trip_error(pixels, depth, pair.inverse_depth, pose, K, other_K, STEP)
        found = {}
        if GEOMETRIC in names:
            found[GEOMETRIC] = multiview_geometric(error, round_trip_weight(error, seen))
        if PHOTOMETRIC in names:
            normal = normal @ view.cam_from_world[:3, :3].T
            normal = normal * torch.rsqrt(normal.square().sum(-1, keepdim=True) + TINY**2)
            image = pair.neighbour_photo.grey
            patches, whole = neighbour_patches(image, pixels, depth, normal, pose, K, other_K, config.patch)
            if pair.neighbour.mask is not None:
                with torch.no_grad():
                    usable = pair.neighbour.mask.to(image.dtype)
                    shares, _ = neighbour_patches(usable, pixels, depth, normal, pose, K, other_K, config.patch)
                    whole &= (shares > WHOLE_SHARE).all(-1)
            found[PHOTOMETRIC] = multiview_photometric(reference, patches, round_trip_weight(error, seen & whole))
        return [found[name] for name in names]

    results = _WithGradients.apply(values, rendering.depth[row, column], rendering.normal[row, column])
    return dict(zip(names, results, strict=True))


def _by_kernels(
    rendering: Rendering, view: View, pair: Pair, config: MultiviewConfig, names: list[str]
) -> dict[str, Tensor]:
    """The same by kernels, which on a GPU may not wait for the number of pixels."""
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


class _WithGradients(torch.autograd.Function):
    """Values and their gradients at once: the clock counts both as the terms' own, and no graph is kept."""

    @staticmethod
    def forward(ctx, function: Callable[..., list[Tensor]], *inputs: Tensor) -> tuple[Tensor, ...]:
        leaves = [values.detach().requires_grad_() for values in inputs]
        with torch.enable_grad():
            results = function(*leaves)
        gradients = [
            torch.autograd.grad(result, leaves, retain_graph=True, allow_unused=True, materialize_grads=True)
            for result in results
        ]
        ctx.save_for_backward(*(gradient for of_result in gradients for gradient in of_result))
        return tuple(result.detach() for result in results)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, *grads: Tensor):
        gradients = ctx.saved_tensors
        count = len(gradients) // len(grads)
        by_input = (gradients[i::count] for i in range(count))
        return None, *(sum(g * of_result for g, of_result in zip(grads, own, strict=True)) for own in by_input)


def drawn_pixels(rendering: Rendering, pair: Pair, count: int) -> tuple[Tensor, Tensor]:
    """(M,) columns and rows, M <= count: fewer where a small part of the image can be compared."""
    height, width = rendering.depth.shape
    drawn = _tries(height * width, pair, count)
    drawn = drawn[pair.photo.textured.flatten()[drawn]]
    alpha, depth = (values.detach().flatten()[drawn] for values in (rendering.alpha, rendering.depth))
    drawn = drawn[(alpha >= MIN_COVERED_ALPHA) & (depth > 0)][:count]
    return drawn % width, drawn // width


def drawn_slots(rendering: Rendering, pair: Pair, count: int) -> Tensor:
    """(count,) int32 of the same pixels, row * width + column, then -1: as many as wanted, however many there are."""
    height, width = rendering.depth.shape
    drawn = upload(_tries(height * width, pair, count).int(), rendering.depth.device)
    alpha, depth = (values.detach().flatten()[drawn] for values in (rendering.alpha, rendering.depth))
    fits = pair.photo.textured.flatten()[drawn] & (alpha >= MIN_COVERED_ALPHA) & (depth > 0)
    slot = torch.where(fits, fits.cumsum(0) - 1, count).clamp(max=count)  # the last one takes all that is left over
    return drawn.new_full((count + 1,), -1).scatter_(0, slot, drawn)[:count]


def _tries(pixels: int, pair: Pair, count: int) -> Tensor:
    return torch.from_numpy(np.random.default_rng(pair.seed).integers(pixels, size=TRIES * count))
