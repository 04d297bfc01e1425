"""Two views of one surface: position and appearance agree (eq. 13-16)."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.geometry.arguments import check_tensor
from room2dgs.geometry.homography import (
    MIN_FACING,
    MIN_WEIGHT,
    plane_distance,
    plane_homography,
    transfer,
    warp_points,
)
from room2dgs.losses.checks import (
    check_images,
    check_intrinsics,
    check_one_type,
    check_patch,
    check_pose,
    check_rows,
    check_step,
    inverse,
)
from room2dgs.losses.sampling import bilinear, patch_offsets

MAX_ERROR_PX = 1.0  # of the round trip; what is farther off is hidden from the neighbour, or wrong beyond repair
MIN_DEPTH_M = 1e-2
MAX_DEPTH_M = 1e3
BRIGHTEST = 1e9  # of a patch's values
MIN_PATCH_VARIANCE = 1e-8  # of the neighbour's patch, grey levels of 0..1


def round_trip_error(
    pixels: Tensor,
    depth: Tensor,
    neighbour_inverse_depth: Tensor,
    neighbour_from_reference: Tensor,
    K_reference: Tensor,
    K_neighbour: Tensor,
    step: int = 1,
) -> tuple[Tensor, Tensor]:
    """e = |p - H_nr H_rn p|: to the neighbour by the reference's surface, and back by the neighbour's (eq. 14).

    H_rn p is the projection of the point that the reference's depth gives p, whatever the normal there; likewise back,
    with the neighbour's depth at H_rn p. That is interpolated as inverse depth, which is linear on planes.

    Args:
        pixels: (M, 2) of the reference view.
        depth: (M,) its z-depth there > 0, metres.
        neighbour_inverse_depth: (h, w) 1 / z-depth, 0 = none; of every `step`-th row and column from the first.
        neighbour_from_reference: (4, 4) rigid.
        K_reference, K_neighbour: (3, 3) pixels at full size.

    Returns:
        (M,) pixels and (M,) bool: the point is inside the neighbour's image, and something is seen there. The error
        means nothing elsewhere.

    Raises:
        TypeError, ValueError: no tensors in floating point, of other shapes, or cameras that cannot be.
    """
    check_rows(2, pixels=pixels)
    check_rows(depth=depth, x=pixels[:, 0])
    check_images(neighbour_inverse_depth=neighbour_inverse_depth)
    check_pose("neighbour_from_reference", neighbour_from_reference)
    check_intrinsics(K_reference=K_reference, K_neighbour=K_neighbour)
    check_one_type(
        pixels=pixels, depth=depth, neighbour_inverse_depth=neighbour_inverse_depth,
        neighbour_from_reference=neighbour_from_reference, K_reference=K_reference, K_neighbour=K_neighbour,
    )  # fmt: skip
    step = check_step(step)
    there, depth_there = transfer(pixels, depth, neighbour_from_reference, K_reference, K_neighbour)
    map_size = torch.tensor(neighbour_inverse_depth.shape[::-1])
    on_map = (there - 0.5) / step + 0.5
    inside = ((on_map >= 0.5) & (on_map <= map_size - 0.5)).all(-1)
    nearness = bilinear(neighbour_inverse_depth, on_map[:, :1], on_map[:, 1:])[:, 0]
    back_pose = inverse("neighbour_from_reference", neighbour_from_reference)
    seen_depth = nearness.clamp_min(1 / MAX_DEPTH_M).reciprocal()
    back, depth_back = transfer(there, seen_depth, back_pose, K_neighbour, K_reference)
    seen = inside & (depth_there > MIN_DEPTH_M) & (nearness > 1 / MAX_DEPTH_M) & (depth_back > MIN_DEPTH_M)
    return torch.linalg.vector_norm(back - pixels, dim=-1), seen


def round_trip_weight(error: Tensor, seen: Tensor) -> Tensor:
    """Weight exp(-e) of each pixel where it is seen and e < 1 px, 0 elsewhere; (M,), no gradient.

    Raises:
        TypeError, ValueError: no error (M,) in floating point, no (M,) bool.
    """
    check_rows(error=error)
    check_tensor("seen", seen, tuple(error.shape), "bool")
    return torch.where(seen & (error < MAX_ERROR_PX), torch.exp(-error), 0.0).detach()


def multiview_geometric(error: Tensor, weight: Tensor) -> Tensor:
    """L_geo: mean of weight * e over the pixels with a weight (eq. 14); 0 without one.

    Args:
        error: (M,) `round_trip_error`.
        weight: (M,) `round_trip_weight`.

    Returns:
        scalar, pixels; differentiable in the error.

    Raises:
        TypeError, ValueError: no tensors (M,) in floating point.
    """
    check_rows(error=error, weight=weight)
    return _mean(error, weight)


def multiview_photometric(reference: Tensor, neighbour: Tensor, weight: Tensor) -> Tensor:
    """L_pho: mean of weight * (1 - NCC) over the pixels with a weight (eq. 15); 0 without one.

    NCC is the signed correlation coefficient: neither brightness nor contrast changes it, a negative costs more than
    none.

    Args:
        reference: (M, P) grey patches, not flat where they have a weight; no gradient.
        neighbour: (M, P) patches of the neighbour's photo where the surface carries those to.
        weight: (M,).

    Returns:
        scalar, differentiable in the neighbour's patches.

    Raises:
        TypeError, ValueError: no tensors in floating point, or of other shapes.
    """
    check_patches(reference, neighbour)
    check_rows(weight=weight, first=reference[:, 0])
    return _mean(1 - correlation(reference.detach(), neighbour), weight)


def correlation(a: Tensor, b: Tensor) -> Tensor:
    """(M,) signed normalised cross-correlation of patches (M, P), in -1..1; nearly flat ones have 0, and so have those
    with values that are not finite or beyond 10^9, whose squares have no room.

    Raises:
        TypeError, ValueError: no tensors in floating point, or of other shapes.
    """
    check_patches(a, b)
    good = ((a.detach().abs() < BRIGHTEST) & (b.detach().abs() < BRIGHTEST)).all(-1, keepdim=True)
    a, b = torch.where(good, a, 0.0), torch.where(good, b, 0.0)
    a, b = a - a.mean(-1, keepdim=True), b - b.mean(-1, keepdim=True)
    a_power, b_power = a.square().mean(-1), b.square().mean(-1)
    scale = (a_power.clamp_min(MIN_PATCH_VARIANCE) * b_power.clamp_min(MIN_PATCH_VARIANCE)).rsqrt()
    return (a * b).mean(-1) * scale


def neighbour_patches(
    image: Tensor,
    pixels: Tensor,
    depth: Tensor,
    normal: Tensor,
    neighbour_from_reference: Tensor,
    K_reference: Tensor,
    K_neighbour: Tensor,
    patch: int,
) -> tuple[Tensor, Tensor]:
    """P_n(H_rn p): the neighbour's photo where each pixel's tangent plane carries the patch around it (eq. 13, 15).

    Args:
        image: (H, W) of the neighbour.
        pixels: (M, 2) of the reference view.
        depth: (M,) its z-depth there > 0, metres.
        normal: (M, 3) its unit normal in the reference camera.
        neighbour_from_reference: (4, 4) rigid.
        K_reference, K_neighbour: (3, 3) pixels.
        patch: side, pixels.

    Returns:
        (M, patch * patch), differentiable in depth and normal, and (M,) bool: the patch is seen well enough to be
        compared, inside the image and from nowhere too near edge-on.

    Raises:
        TypeError, ValueError: no tensors in floating point, of other shapes, or cameras that cannot be.
    """
    check_rows(2, pixels=pixels)
    check_rows(depth=depth, x=pixels[:, 0])
    check_tensor("normal", normal, (len(pixels), 3))
    check_images(image=image)
    check_pose("neighbour_from_reference", neighbour_from_reference)
    check_intrinsics(K_reference=K_reference, K_neighbour=K_neighbour)
    check_one_type(
        image=image, pixels=pixels, depth=depth, normal=normal,
        neighbour_from_reference=neighbour_from_reference, K_reference=K_reference, K_neighbour=K_neighbour,
    )  # fmt: skip
    patch = check_patch(patch)
    ones = torch.ones_like(depth)[:, None]
    rays = torch.cat([pixels, ones], dim=-1) @ inverse("K_reference", K_reference).T
    distance = plane_distance(normal, rays, depth)
    homography = plane_homography(normal, distance, neighbour_from_reference, K_reference, K_neighbour)
    offsets = patch_offsets(patch, pixels.dtype)
    x, y, weight = warp_points(homography, pixels, offsets)
    # a square before the camera maps to a convex quadrangle: its corners tell
    corners = [0, patch - 1, -patch, -1]
    corner_x, corner_y, weight = (values.detach()[:, corners] for values in (x, y, weight))
    height, width = image.shape
    inside = (corner_x >= 0.5) & (corner_x <= width - 0.5) & (corner_y >= 0.5) & (corner_y <= height - 0.5)
    whole = (inside & (weight > MIN_WEIGHT)).all(-1)
    facing = (normal * rays).sum(-1).abs() >= MIN_FACING
    return bilinear(image, x, y), whole & facing


def check_patches(a: Tensor, b: Tensor) -> None:
    """Both (M, P), floating point.

    Raises:
        TypeError, ValueError: they are not.
    """
    check_tensor("patches", a, (len(a) if isinstance(a, Tensor) and a.ndim else None, None))
    check_tensor("the neighbour's patches", b, tuple(a.shape))


def _mean(values: Tensor, weight: Tensor) -> Tensor:
    counts = weight > 0
    # what has no weight may be anything, infinite included
    return (torch.where(counts, values, 0.0) * weight).sum() / max(1, int(torch.count_nonzero(counts)))
