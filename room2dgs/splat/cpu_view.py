"""One view by the compiled kernels (`_C`), forward and back: tensors in, tensors out, no autograd.

`kind` is of the frames that draw it, and `more` what their `forward` takes besides.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.kernels.calls import call
from room2dgs.splat import frames
from room2dgs.splat.checks import check_center_px, check_values

CPU = frames.Kind(_C.RasterFrame, torch.device("cpu"))


def forward(
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, center_px,
    width, height, near_m, opacity_floor, with_normal, with_distortion, *, kind=CPU, more=(),
):  # fmt: skip
    """Images as in `Rendering`, and the state that the backward pass needs (`frames`)."""
    check_values(K, cam_from_world, background, near_m, opacity_floor)
    check_center_px(center_px)
    images = empty_images(centers, width, height)
    frame = frames.acquire(kind)
    number = _draw(
        frame, (centers, rotations, scales, opacities, sh), cam_from_world, K, background, images,
        width, height, near_m, opacity_floor, with_normal, with_distortion, more,
    )  # fmt: skip
    return *images, frames.keep(kind, frame, number)


def empty_images(like: Tensor, width: int, height: int) -> list[Tensor]:
    color, normal = (like.new_empty(height, width, 3, dtype=torch.float32) for _ in range(2))
    alpha, depth, median, distortion = (like.new_empty(height, width, dtype=torch.float32) for _ in range(4))
    return [color, alpha, depth, median, normal, distortion]


def _draw(
    frame, parameters, cam_from_world, K, background, images, width, height, near_m, opacity_floor, with_normal,
    with_distortion, more: tuple[Any, ...],
) -> int:  # fmt: skip
    """Fill the images and the frame; gives the view's number there."""
    *others, normal, distortion = images
    number = call(
        frame.forward, *(x.detach().contiguous() for x in parameters), _doubles(cam_from_world), _doubles(K),
        width, height, near_m, opacity_floor,
        background.detach().to(torch.float32).contiguous(), *others,
        normal if with_normal or with_distortion else None, distortion if with_distortion else None,
        *more,
    )  # fmt: skip
    if not with_distortion:
        distortion.zero_()
    if not with_normal:
        normal.zero_()
    return number


def _doubles(matrix: Tensor) -> Tensor:
    return matrix.detach().to(torch.float64).contiguous()


def backward(
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, alpha, depth, state,
    to_color, to_alpha, to_depth, to_median, to_normal, to_distortion,
    width, height, near_m, opacity_floor, with_normal, with_distortion, with_background, *, kind=CPU, more=(),
):  # fmt: skip
    """Gradients of the surfels' five tensors, the pose, K, the background (if wanted) and the projected centres."""
    parameters = [x.detach().contiguous() for x in (centers, rotations, scales, opacities, sh)]
    known = frames.find(state)
    if known is not None:
        frame, number = known
    else:  # the state is a copy
        frame = frames.acquire(kind)
        number = _draw(
            frame, parameters, cam_from_world, K, background, empty_images(centers, width, height),
            width, height, near_m, opacity_floor, with_normal, with_distortion, more,
        )  # fmt: skip
    flowing = [
        x.contiguous() if x is not None and wanted else None
        for x, wanted in zip(
            (to_color, to_alpha, to_depth, to_median, to_normal, to_distortion),
            (True, True, True, True, with_normal, with_distortion),
            strict=True,
        )
    ]
    to = empty_gradients(*parameters)
    to_pose, to_K = torch.empty(4, 4, dtype=torch.float64), torch.empty(3, 3, dtype=torch.float64)
    to_background = torch.zeros(3, dtype=torch.float64)
    call(
        frame.backward, number, *parameters, alpha.contiguous(), depth.contiguous(), *flowing, *to, to_pose, to_K,
        to_background if with_background and to_color is not None else None,
    )  # fmt: skip
    if known is None:
        frames.release(kind, frame)
    *to, to_center_px = to
    return (
        *to,
        *(x.to(y.dtype) for x, y in ((to_pose, cam_from_world), (to_K, K), (to_background, background))),
        to_center_px,
    )


def empty_gradients(centers: Tensor, *others: Tensor) -> list[Tensor]:
    to = [x.new_empty(x.shape) for x in (centers, *others)]
    return [*to, centers.new_empty(centers.shape[0], 2)]
