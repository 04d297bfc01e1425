"""One view by block code: on a GPU (`_cuda`), or the same source as plain C++ (`_C.device`). Tensors in, tensors out.

What `cpu_view` is to the CPU's own kernels. `frame_class` is the extension's that draws it, and `more` what its
`forward` takes besides. Values are checked after the kernels have seen them, from numbers that come back with the
counts that the host waits for: checking them before would be another wait.
"""

from __future__ import annotations

from typing import Any

import torch

from room2dgs.kernels.builds import Build
from room2dgs.kernels.calls import call
from room2dgs.splat import cpu_view, frames
from room2dgs.splat.checks import check_floor, check_near, check_values


def forward(
    build: Build,
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, center_px,
    width, height, near_m, opacity_floor, with_normal, with_distortion, *, frame_class="BlockFrame", more=(),
):  # fmt: skip
    """Images as in `Rendering`, and the state that the backward pass needs (`frames`)."""
    images = cpu_view.empty_images(centers, width, height)
    kind = frames.Kind(getattr(build.extension, frame_class), centers.device)
    frame = frames.acquire(kind)
    number = _draw(
        build, frame, [x.detach().contiguous() for x in (centers, rotations, scales, opacities, sh)],
        cam_from_world, K, background, center_px, images, width, height, near_m, opacity_floor,
        with_normal, with_distortion, more,
    )  # fmt: skip
    return *images, frames.keep(kind, frame, number)


def _draw(
    build, frame, parameters, cam_from_world, K, background, center_px, images, width, height, near_m, opacity_floor,
    with_normal, with_distortion, more: tuple[Any, ...],
) -> int:  # fmt: skip
    """Fill the images and the frame; gives the view's number there."""
    check_near(near_m)
    check_floor(opacity_floor)
    *others, normal, distortion = images
    shift = None if center_px is None else center_px.detach().to(torch.float32).contiguous()
    number = call(
        frame.forward, *parameters, *(x.detach().to(torch.float64).contiguous() for x in (cam_from_world, K)),
        width, height, near_m, opacity_floor,
        background.detach().to(torch.float32).contiguous(), *others,
        normal if with_normal or with_distortion else None, distortion if with_distortion else None,
        *more, shift, queue=build.queue(parameters[0]),
    )  # fmt: skip
    pose, intrinsics, behind = (torch.tensor(x, dtype=torch.float64) for x in frame.camera())
    check_values(intrinsics.reshape(3, 3), pose.reshape(4, 4), behind, near_m, opacity_floor)
    if frame.moved:
        raise ValueError("center_px is not zero; it exists for its gradient and cannot move projected centres")
    if not with_distortion:
        distortion.zero_()
    if not with_normal:
        normal.zero_()
    return number


def backward(
    build: Build,
    centers, rotations, scales, opacities, sh, cam_from_world, K, background, alpha, depth, state,
    to_color, to_alpha, to_depth, to_median, to_normal, to_distortion,
    width, height, near_m, opacity_floor, with_normal, with_distortion, with_background, *, frame_class="BlockFrame",
    more=(),
):  # fmt: skip
    """Gradients of the surfels' five tensors, the pose, K, the background (if wanted) and the projected centres."""
    parameters = [x.detach().contiguous() for x in (centers, rotations, scales, opacities, sh)]
    kind = frames.Kind(getattr(build.extension, frame_class), centers.device)
    known = frames.find(state)
    if known is not None:
        frame, number = known
    else:  # the state is a copy
        frame = frames.acquire(kind)
        number = _draw(
            build, frame, parameters, cam_from_world, K, background, None,
            cpu_view.empty_images(centers, width, height), width, height, near_m, opacity_floor,
            with_normal, with_distortion, more,
        )  # fmt: skip
    wanted = (True, True, True, True, with_normal, with_distortion)
    gradients = (to_color, to_alpha, to_depth, to_median, to_normal, to_distortion)
    flowing = [x.contiguous() if x is not None and w else None for x, w in zip(gradients, wanted, strict=True)]
    to = cpu_view.empty_gradients(*parameters)
    to_camera = torch.zeros(28, dtype=torch.float64, device=centers.device)  # at once: each costs a GPU's launch
    to_pose, to_K, to_background = to_camera[:16].view(4, 4), to_camera[16:25].view(3, 3), to_camera[25:]
    call(
        frame.backward, number, *parameters, alpha.contiguous(), depth.contiguous(), *flowing, *to, to_pose, to_K,
        to_background if with_background and to_color is not None else None, queue=build.queue(centers),
    )  # fmt: skip
    if known is None:
        frames.release(kind, frame)
    *to, to_center_px = to
    cameras = ((to_pose, cam_from_world), (to_K, K), (to_background, background))
    # an operator's outputs may not share memory
    return *to, *(x.to(y.dtype, copy=True) for x, y in cameras), to_center_px
