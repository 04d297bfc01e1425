"""The two regularisers of 2DGS: thin surfaces, and rendered normals that agree with the rendered depth."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.block_code import build_for
from room2dgs.geometry.arguments import check_tensor
from room2dgs.geometry.kernel_arguments import intrinsics, rotation_of, runs_compiled
from room2dgs.kernel_calls import call
from room2dgs.losses import blocks, reference
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

    float32 on the CPU takes the compiled kernel: value and gradients in one sweep, the same bits on any
    number of threads.

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
    by_blocks = build_for(*maps)
    if not by_blocks and not runs_compiled(*maps):
        return reference.normal_consistency(*maps, K, cam_from_world)
    pose = cam_from_world if isinstance(cam_from_world, Tensor) else torch.from_numpy(np.asarray(cam_from_world))
    if by_blocks:
        return blocks.normal_consistency(*maps, torch.as_tensor(K), pose)
    return _by_kernel(*maps, intrinsics(K), pose)


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


def _by_kernel(depth: Tensor, alpha: Tensor, normal: Tensor, pinhole: tuple[float, ...], pose: Tensor) -> Tensor:
    grad_depth, grad_normal = (torch.empty(maps.shape, dtype=torch.float32) for maps in (depth, normal))
    grad_pose = torch.zeros(4, 4, dtype=torch.float64)
    grad_rotation = np.empty((3, 3))
    maps = (x.detach().contiguous() for x in (depth, alpha, normal))
    value = call(_C.normal_consistency, *maps, *pinhole, rotation_of(pose), grad_depth, grad_normal, grad_rotation)
    grad_pose[:3, :3] = torch.from_numpy(grad_rotation)
    return with_gradients(depth.new_tensor(value), [depth, normal, pose], [grad_depth, grad_normal, grad_pose.to(pose)])
