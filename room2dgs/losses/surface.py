"""The two regularisers of 2DGS: thin surfaces, and rendered normals that agree with the rendered depth."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.geometry.arguments import check_tensor
from room2dgs.geometry.kernel_arguments import intrinsics, rotation_of
from room2dgs.kernels.builds import Build
from room2dgs.kernels.calls import call
from room2dgs.kernels.operators import has_kernels, operator
from room2dgs.losses import reference
from room2dgs.losses.block_losses import camera_on, empty_like, empty_sums, losses_of, plain
from room2dgs.losses.checks import check_images
from room2dgs.losses.known_gradients import with_gradients
from room2dgs.splat.types import Rendering


def distortion(rendering: Rendering) -> Tensor:
    """Mean over all pixels of the rendering's distortion map (2DGS, eq. 13); scalar.

    Raises:
        TypeError, ValueError: it is no tensor in floating point, or empty.
    """
    check_images(distortion=rendering.distortion)
    return rendering.distortion.mean()


def normal_consistency(
    rendering: Rendering, K: Tensor | np.ndarray, cam_from_world: Tensor | np.ndarray, depth: str = "expected"
) -> Tensor:
    """Mean over all pixels of a (a - N . n_s) (2DGS, eq. 14, with the rendered normal).

    N is the rendered normal, not normalised; n_s the unit normal of the rendered depth by central differences
    of its points at pixel centres (`geometry.depth_to_normals`), world frame, facing the camera; a the
    rendered alpha, held constant. The gradient is that of 2DGS's 1 - N . (a n_s). The value differs by what
    the gradient does not see, so that it is 0 for a perfect surface whatever its coverage. Pixels on the
    border, and those where one of the five depths is 0, count 0.

    float32 takes compiled kernels: value and gradients in one sweep, the same bits on any number of threads.

    Args:
        rendering: of one view, (H, W) maps.
        K: (3, 3) intrinsics without skew, pixels; no gradient.
        cam_from_world: (4, 4) pose of the view. A tensor that wants a gradient gets the one through the
            rotation of n_s; what flows through the maps is the rasterizer's.
        depth: which depth n_s comes from, "expected" or "median".

    Returns:
        scalar, differentiable once with respect to the rendering's normal and the chosen depth.

    Raises:
        TypeError: a map is no tensor in floating point, or the camera no matrices.
        ValueError: `depth` is neither; maps that are empty or of different sizes; matrices of other shapes.
    """
    if depth not in ("expected", "median"):
        raise ValueError(f"depth={depth!r} is not known; choose expected or median")
    chosen = rendering.depth if depth == "expected" else rendering.median_depth
    maps = (chosen, rendering.alpha, rendering.normal)
    check_images(depth=maps[0], alpha=maps[1])
    check_images(3, normal=maps[2])
    if not maps[0].shape == maps[1].shape == maps[2].shape[:2]:
        raise ValueError("depth, alpha and normal differ in size")
    check_matrix("K", K, (3, 3))
    check_matrix("cam_from_world", cam_from_world, (4, 4))
    if not has_kernels(*maps):
        return reference.normal_consistency(*maps, K, cam_from_world)
    pose = cam_from_world if isinstance(cam_from_world, Tensor) else torch.from_numpy(np.asarray(cam_from_world))
    value, grad_depth, grad_normal, grad_rotation = NORMAL_CONSISTENCY(*maps, torch.as_tensor(K), pose)
    inputs, gradients = [maps[0], maps[2]], [grad_depth, grad_normal]
    if pose.requires_grad:
        grad_pose = pose.new_zeros(4, 4)
        grad_pose[:3, :3] = grad_rotation
        inputs, gradients = [*inputs, pose], [*gradients, grad_pose]
    return with_gradients(value, inputs, gradients)


def check_matrix(name: str, matrix: Tensor | np.ndarray, shape: tuple[int, int]) -> None:
    """Of a camera.

    Raises:
        TypeError: it is neither a tensor nor an array of numbers in floating point.
        ValueError: another shape, or it has no values.
    """
    if not isinstance(matrix, Tensor):
        array = np.asarray(matrix)
        if array.dtype.kind != "f":
            raise TypeError(f"{name} is of {array.dtype}, not floating point")
        matrix = torch.from_numpy(array)
    check_tensor(name, matrix, shape)


def _on_cpu(
    depth: Tensor, alpha: Tensor, normal: Tensor, K: Tensor, pose: Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    grad_depth, grad_normal, grad_rotation = empty_like(depth), empty_like(normal), np.empty((3, 3))
    maps = map(plain, (depth, alpha, normal))
    value = call(
        _C.normal_consistency, *maps, *intrinsics(K), rotation_of(pose), grad_depth, grad_normal, grad_rotation
    )  # fmt: skip
    return depth.new_tensor(value), grad_depth, grad_normal, torch.from_numpy(grad_rotation)


def _by_block_code(
    build: Build, depth: Tensor, alpha: Tensor, normal: Tensor, K: Tensor, pose: Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    losses, queue = losses_of(build, depth)
    grad_depth, grad_normal, values = empty_like(depth), empty_like(normal), empty_sums(depth, 10)
    maps = map(plain, (depth, alpha, normal))
    cameras = camera_on(K, depth), camera_on(pose, depth)
    call(losses.normal_consistency, *maps, *cameras, grad_depth, grad_normal, values, queue)
    return values[0].to(depth.dtype), grad_depth, grad_normal, values[1:].reshape(3, 3)


NORMAL_CONSISTENCY = operator(
    "normal_consistency(Tensor depth, Tensor alpha, Tensor normal, Tensor K, Tensor cam_from_world) "
    "-> (Tensor, Tensor, Tensor, Tensor)",
    _by_block_code,
    _on_cpu,
)
