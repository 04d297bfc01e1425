"""The multi-view terms in torch, step by step, of any floating type: the oracle of `losses.compared_pixels`."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.config import MultiviewConfig
from room2dgs.geometry.homography import relative_pose
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
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.terms.multiview import GEOMETRIC, PHOTOMETRIC, tries
from room2dgs.train.views import View

WHOLE_SHARE = 1 - 1e-4  # of usable pixels around each sample of a patch; interpolation rounds
TINY = 1e-3  # rendered normals that cancel have no direction; their gradient stays below 1 / TINY


def multiview_terms(
    rendering: Rendering, view: View, pair: Pair, config: MultiviewConfig, names: list[str]
) -> dict[str, Tensor]:
    """As `train.terms.multiview.multiview_terms`."""
    column, row = drawn_pixels(rendering, pair, config.samples)
    reference = patches_at(pair.photo.grey, column, row, config.patch)
    pixels = torch.stack([column, row], dim=-1) + 0.5
    pose = relative_pose(view.cam_from_world, pair.neighbour.cam_from_world)
    K, other_K = view.K, pair.neighbour.K

    def values(depth: Tensor, normal: Tensor) -> dict[str, Tensor]:
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
        return found

    return values(rendering.depth[row, column], rendering.normal[row, column])


def drawn_pixels(rendering: Rendering, pair: Pair, count: int) -> tuple[Tensor, Tensor]:
    """(M,) columns and rows, M <= count: fewer where a small part of the image can be compared."""
    height, width = rendering.depth.shape
    drawn = tries(height * width, pair, count)
    drawn = drawn[pair.photo.textured.flatten()[drawn]]
    alpha, depth = (values.detach().flatten()[drawn] for values in (rendering.alpha, rendering.depth))
    drawn = drawn[(alpha >= MIN_COVERED_ALPHA) & (depth > 0)][:count]
    return drawn % width, drawn // width
