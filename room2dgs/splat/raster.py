"""The compiled rasterizer behind torch's autograd."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.cores import available_cores
from room2dgs.splat.constants import SH_DEGREE_OF
from room2dgs.splat.types import Rendering, Surfels


def set_threads(count: int | None = None) -> int:
    """Threads of the compiled kernels from now on; None: every core that this process may use.

    The results are the same bits for any number.

    Returns:
        The number in use: smaller than `count` where the system refuses to start as many.

    Raises:
        ValueError: not in 1..1024.
    """
    return _C.set_threads(available_cores() if count is None else count)


def render(
    surfels: Surfels,
    K: Tensor,
    cam_from_world: Tensor,
    width: int,
    height: int,
    *,
    background: Tensor | None = None,
    near_m: float = 0.05,
    center_px: Tensor | None = None,
    with_normal: bool = True,
    with_distortion: bool = True,
) -> Rendering:
    """Render one view on the CPU, in float32.

    Differentiable with respect to every tensor of `surfels` and to `cam_from_world`; not to K, nor to the background.
    The same inputs give the same bits on any number of threads.

    Args:
        surfels: float32; see `Surfels`.
        K: (3, 3) intrinsics in pixels, centres at +0.5.
        cam_from_world: (4, 4) pose, metres.
        width, height: image size in pixels.
        background: (3,) RGB, black by default.
        near_m: surfels with centres nearer than this, and parts of discs that are, are not drawn.
        center_px: (N, 2) zeros that require grad: their gradient is that of the projected centres, in 1/pixel.
        with_normal, with_distortion: leave out an output that is not wanted (it is zeros then).

    Returns:
        `Rendering`.

    Raises:
        ValueError: shapes, types or sizes that do not fit.
    """
    _check(surfels, K, cam_from_world, width, height)
    if background is None:
        background = torch.zeros(3, dtype=torch.float32)
    if tuple(background.shape) != (3,):
        raise ValueError(f"background has shape {tuple(background.shape)}, not (3,)")
    if center_px is None:
        center_px = torch.zeros(0, dtype=torch.float32)
    elif tuple(center_px.shape) != (len(surfels.centers), 2):
        raise ValueError(f"center_px has shape {tuple(center_px.shape)}, not ({len(surfels.centers)}, 2)")
    outputs = _Rasterize.apply(
        *surfels,
        cam_from_world,
        center_px,
        K,
        background,
        width,
        height,
        near_m,
        with_normal,
        with_distortion,
    )
    return Rendering(*outputs)


def _check(surfels: Surfels, K: Tensor, cam_from_world: Tensor, width: int, height: int) -> None:
    count = len(surfels.centers)
    shapes = {"centers": (count, 3), "rotations": (count, 4), "scales": (count, 2), "opacities": (count,)}
    for name, shape in shapes.items():
        if tuple(getattr(surfels, name).shape) != shape:
            raise ValueError(f"surfels.{name} has shape {tuple(getattr(surfels, name).shape)}, not {shape}")
    sh = surfels.sh
    if sh.ndim != 3 or sh.shape[0] != count or sh.shape[1] not in SH_DEGREE_OF or sh.shape[2] != 3:
        raise ValueError(f"surfels.sh has shape {tuple(sh.shape)}, not ({count}, 1 | 4 | 9 | 16, 3)")
    for name, tensor in zip(Surfels._fields, surfels, strict=True):
        if tensor.dtype != torch.float32 or tensor.device.type != "cpu":
            raise ValueError(
                f"surfels.{name} is {tensor.dtype} on {tensor.device}; the compiled rasterizer takes float32 on the CPU"
            )
    if tuple(K.shape) != (3, 3) or tuple(cam_from_world.shape) != (4, 4):
        raise ValueError(
            f"K is {tuple(K.shape)} and cam_from_world {tuple(cam_from_world.shape)}, not (3, 3) and (4, 4)"
        )
    if not (1 <= width <= 16384 and 1 <= height <= 16384):
        raise ValueError(f"image size {width} x {height} is not in 1..16384")


set_threads()


class _Frames:
    """Buffers of finished views, used again: fresh memory would cost page faults at every iteration."""

    free: list = []  # noqa: RUF012

    @classmethod
    def take(cls) -> _C.RasterFrame:
        try:  # not a look before the leap: another thread may take the last one
            return cls.free.pop()
        except IndexError:
            return _C.RasterFrame()

    @classmethod
    def give(cls, frame: _C.RasterFrame) -> None:
        if len(cls.free) < 4:
            cls.free.append(frame)


class _Held:
    """A frame that goes back to the shelf with the graph that needed it."""

    def __init__(self) -> None:
        self.frame = _Frames.take()

    def __del__(self) -> None:
        _Frames.give(self.frame)


class _Rasterize(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx, centers, rotations, scales, opacities, sh, cam_from_world, center_px,
        K, background, width, height, near_m, with_normal, with_distortion,
    ):  # fmt: skip
        parameters = [x.detach().contiguous() for x in (centers, rotations, scales, opacities, sh)]
        pose = cam_from_world.detach().to(torch.float64).contiguous()
        color, normal = (torch.empty(height, width, 3, dtype=torch.float32) for _ in range(2))
        alpha, depth, median, distortion = (torch.empty(height, width, dtype=torch.float32) for _ in range(4))
        held = _Held()
        ctx.view = held.frame.forward(
            *parameters, pose, K.detach().to(torch.float64).contiguous(), width, height, near_m,
            background.detach().to(torch.float32).contiguous(), color, alpha, depth, median,
            normal if with_normal or with_distortion else None, distortion if with_distortion else None,
        )  # fmt: skip
        if not with_distortion:
            distortion.zero_()
        if not with_normal:
            normal.zero_()
        ctx.held = held
        ctx.pose_like = cam_from_world
        ctx.wants_center_px = center_px.numel() > 0
        ctx.with_distortion, ctx.with_normal = with_distortion, with_normal
        ctx.save_for_backward(*parameters, alpha, depth)
        ctx.set_materialize_grads(False)
        return color, alpha, depth, median, normal, distortion

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, *gradients):
        *parameters, alpha, depth = ctx.saved_tensors
        wanted = [True, True, True, True, ctx.with_normal, ctx.with_distortion]
        flowing = [g.contiguous() if g is not None and w else None for g, w in zip(gradients, wanted, strict=True)]
        to = [torch.empty_like(x) for x in parameters]
        to_center_px = torch.empty(len(parameters[0]), 2, dtype=torch.float32)
        to_pose = torch.empty(4, 4, dtype=torch.float32)
        ctx.held.frame.backward(ctx.view, *parameters, alpha, depth, *flowing, *to, to_center_px, to_pose)
        return (
            *to,
            to_pose.to(ctx.pose_like.dtype),
            to_center_px if ctx.wants_center_px else None,
            *[None] * 7,
        )
