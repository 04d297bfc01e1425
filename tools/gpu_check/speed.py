"""Milliseconds of forward and backward on a backend's own device, and of gsplat's 2DGS on the same surfels."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from room2dgs import splat
from room2dgs.bench.raster_scene import box_surfels, inside_view
from room2dgs.splat import Gaussians, Rendering, Surfels
from room2dgs.tools.gpu_check.rendering import device_of

NEAR_M = 0.2  # see tools/roofline/scene.py
Row = dict[str, Any]
Draw = Callable[[Any, Tensor, Tensor, int, int], tuple[Tensor, Tensor, Tensor]]
FLAT = 0.1  # a Gaussian's third scale, of the smaller one of its disc
RENDER: dict[str, Callable[..., Rendering]] = {"surfels": splat.render, "Gaussians": splat.render_gaussians}


def speed_row(backend: str, width: int, height: int, count: int, kind: str = "surfels", repeats: int = 10) -> Row:
    """The box room: colour, depth and normals, gradients of all parameters; medians.

    gsplat's, of its 2DGS, are None without it, and where `kind` is "Gaussians".
    """
    device = device_of(backend)

    def ours(splats: Any, K: Tensor, pose: Tensor, w: int, h: int) -> tuple[Tensor, Tensor, Tensor]:
        out = RENDER[kind](splats, K, pose, w, h, near_m=NEAR_M, with_distortion=False)
        return out.color, out.depth, out.normal

    row: Row = {"width": width, "height": height, "surfels": count, "kind": kind, "gsplat": None}
    surfels = box_surfels(count)
    splats = surfels if kind == "surfels" else _thickened(surfels)
    row["ours"] = _milliseconds(ours, splats, device, width, height, repeats)
    if kind == "surfels" and device == "cuda" and importlib.util.find_spec("gsplat"):
        row["gsplat"] = _milliseconds(_gsplat, surfels, device, width, height, repeats)
    return row


def _thickened(surfels: Surfels) -> Gaussians:
    third = FLAT * surfels.scales.amin(dim=1, keepdim=True)
    return Gaussians(*surfels._replace(scales=torch.cat([surfels.scales, third], dim=1)))


def _gsplat(surfels: Surfels, K: Tensor, pose: Tensor, w: int, h: int) -> tuple[Tensor, Tensor, Tensor]:
    from gsplat import rasterization_2dgs

    scales = torch.cat([surfels.scales, torch.ones_like(surfels.scales[:, :1])], dim=-1)
    images, _, normals, *_ = rasterization_2dgs(
        surfels.centers, surfels.rotations, scales, surfels.opacities, surfels.sh, pose[None], K[None], w, h,
        near_plane=NEAR_M, sh_degree=0, render_mode="RGB+ED",
    )  # fmt: skip
    return images[0, ..., :3], images[0, ..., 3], normals[0]


def _milliseconds(
    draw: Draw, splats: Surfels | Gaussians, device: str, width: int, height: int, repeats: int
) -> dict[str, float]:
    leaves = type(splats)(*(x.to(device).requires_grad_() for x in splats))
    K, pose = (x.to(device) for x in inside_view(width, height))
    g = torch.Generator().manual_seed(1)
    to = [torch.randn(height, width, *tail, generator=g).to(device) for tail in ((3,), (), (3,))]
    laps: dict[str, list[float]] = {"forward_ms": [], "backward_ms": []}
    for _ in range(repeats + 2):
        start = _now(device)
        images = draw(leaves, K, pose, width, height)
        middle = _now(device)
        torch.autograd.grad(images, list(leaves), to)
        laps["forward_ms"].append(1e3 * (middle - start))
        laps["backward_ms"].append(1e3 * (_now(device) - middle))
    # the first two compile, allocate and fill caches
    return {name: sorted(times[2:])[repeats // 2] for name, times in laps.items()}


def _now(device: str) -> float:
    if device == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter()
