"""Both multi-view losses of drawn pixels at once, by compiled kernels: what `multiview` has step by step.

The kernels are those for CUDA; as plain C++ they are faster than torch's operators on the CPU, too.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.arguments import check_same_device, check_tensor, whole_number
from room2dgs.kernels.builds import Build
from room2dgs.kernels.calls import call
from room2dgs.kernels.operators import operator
from room2dgs.losses.block_losses import camera_on, empty_sums, losses_of, plain, plain_or_none
from room2dgs.losses.checks import check_grey, check_images, check_intrinsics, check_mask, check_pose, check_step

MAX_PATCH = 31  # a patch's side, pixels


class Photo(NamedTuple):
    """A view's photo.

    Attributes:
        grey: (H, W) float32, about 0..1.
        K: (3, 3) intrinsics without skew, pixels.
        cam_from_world: (4, 4) pose.
    """

    grey: Tensor
    K: Tensor
    cam_from_world: Tensor


class Neighbour(NamedTuple):
    """The view that pixels are compared with.

    Attributes:
        photo: of (h, w) pixels.
        usable: (h, w) bool, pixels of the photo that may be compared; None: all.
        inverse_depth: of every `step`-th row and column, 1/m, 0 = none.
        step: from 1.
    """

    photo: Photo
    usable: Tensor | None
    inverse_depth: Tensor
    step: int


def multiview_losses(
    depth: Tensor, normal: Tensor | None, pixels: Tensor, photo: Photo, neighbour: Neighbour, patch: int
) -> Tensor:
    """(2,) `multiview_geometric` and `multiview_photometric` of drawn pixels; differentiable in depth and normal.

    Args:
        depth: (H, W) rendered z-depth, metres, above 0 where a pixel is drawn.
        normal: (H, W, 3) rendered, world frame, of any length; None: the second value is 0.
        pixels: (M,) int32, row * W + column; below 0: none.
        photo: of the rendered view.
        patch: side, pixels, odd, 31 at most.

    Raises:
        TypeError, ValueError: tensors of other types and shapes, cameras or a patch that cannot be; on the CPU, where
            reading values waits for nothing, pixels outside of the image and levels far from 0..1.
    """
    _check_maps(depth, normal, photo, neighbour)
    check_intrinsics(**{"K": photo.K, "the neighbour's K": neighbour.photo.K})
    check_pose("cam_from_world", photo.cam_from_world)
    check_pose("the neighbour's cam_from_world", neighbour.photo.cam_from_world)
    if whole_number("patch", patch, 1) > MAX_PATCH or patch % 2 == 0:
        raise ValueError(f"patch is {patch}; it is to be odd and {MAX_PATCH} at most")
    _check_pixels(pixels, depth)
    if depth.device.type == "cpu":
        check_grey(**{"grey": photo.grey, "the neighbour's grey": neighbour.photo.grey})
    return _Multiview.apply(depth, normal, pixels.contiguous(), photo, neighbour, patch)


def _check_maps(depth: Tensor, normal: Tensor | None, photo: Photo, neighbour: Neighbour) -> None:
    other = neighbour.photo
    maps = {
        "depth": depth, "grey": photo.grey, "the neighbour's grey": other.grey,
        "inverse_depth": neighbour.inverse_depth,
    }  # fmt: skip
    check_images(**maps)
    step = check_step(neighbour.step)
    kept = tuple(-(-side // step) for side in other.grey.shape)
    if photo.grey.shape != depth.shape or neighbour.inverse_depth.shape != kept:
        raise ValueError("depth and photos differ in size")
    if normal is not None:
        check_tensor("normal", normal, (*depth.shape, 3))
        check_same_device(depth=depth, normal=normal)
        maps["normal"] = normal
    if any(x.dtype != torch.float32 for x in maps.values()):
        raise TypeError("maps and photos are to be of float32")
    if neighbour.usable is not None:
        check_mask("usable", neighbour.usable)
        check_same_device(depth=depth, usable=neighbour.usable)
        if neighbour.usable.shape != other.grey.shape:
            raise ValueError("usable and the neighbour's photo differ in size")


def _check_pixels(pixels: Tensor, depth: Tensor) -> None:
    if not isinstance(pixels, Tensor) or pixels.dtype != torch.int32 or pixels.ndim != 1:
        raise TypeError("pixels are no tensor (M,) of int32")
    check_same_device(depth=depth, pixels=pixels)
    if depth.device.type == "cpu" and len(pixels) and pixels.max().item() >= depth.numel():
        raise ValueError(f"pixels name {pixels.max().item()}, but the image has {depth.numel()}, counted from 0")


def _by_block_code(
    build: Build,
    depth: Tensor,
    normal: Tensor | None,
    pixels: Tensor,
    grey: Tensor,
    K: Tensor,
    pose: Tensor,
    other_grey: Tensor,
    usable: Tensor | None,
    inverse_depth: Tensor,
    step: int,
    other_K: Tensor,
    other_pose: Tensor,
    patch: int,
) -> tuple[Tensor, Tensor, Tensor]:
    """Values and numbers of pixels (4,) float64, and each pixel's gradients, not yet divided by these numbers."""
    losses, queue = losses_of(build, depth)
    to_depth, to_normal = (depth.new_empty(len(pixels), n) for n in (2, 3))
    values = empty_sums(depth, 4)
    cameras = (camera_on(x, depth) for x in (K, pose, other_K, other_pose))
    call(
        losses.multiview, plain(depth), plain_or_none(normal), pixels, plain(grey), plain(other_grey),
        plain_or_none(usable), plain(inverse_depth), step, *cameras, patch, to_depth, to_normal, values, queue,
    )  # fmt: skip
    return values, to_depth, to_normal


MULTIVIEW = operator(
    "multiview(Tensor depth, Tensor? normal, Tensor pixels, Tensor grey, Tensor K, Tensor cam_from_world, "
    "Tensor other_grey, Tensor? usable, Tensor inverse_depth, int step, Tensor other_K, Tensor other_cam_from_world, "
    "int patch) -> (Tensor, Tensor, Tensor)",
    _by_block_code,
)


class _Multiview(torch.autograd.Function):
    @staticmethod
    def forward(ctx, depth, normal, pixels, photo: Photo, neighbour: Neighbour, patch: int) -> Tensor:
        other, usable, inverse_depth, step = neighbour
        values, to_depth, to_normal = MULTIVIEW(
            depth, normal, pixels, *photo, other.grey, usable, inverse_depth, step, other.K, other.cam_from_world, patch
        )  # fmt: skip
        ctx.save_for_backward(pixels, to_depth, to_normal, values[2:])
        ctx.shapes = depth.shape, None if normal is None else normal.shape
        return values[:2].to(depth.dtype)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad: Tensor):
        pixels, to_depth, to_normal, counts = ctx.saved_tensors
        share = grad / counts.to(grad.dtype)
        # a pixel may be drawn twice; added up in one order, and not by atomics. What is below 0 has no gradient.
        where = (pixels.clamp(min=0).long(),)
        depth, normal = ctx.shapes
        by_depth = to_depth.new_zeros(depth.numel()).index_put_(where, to_depth @ share, accumulate=True).view(depth)
        if normal is None:
            return by_depth, *[None] * 5
        by_normal = to_normal.new_zeros(depth.numel(), 3).index_put_(where, to_normal * share[1], accumulate=True)
        return by_depth, by_normal.view(normal), *[None] * 4
