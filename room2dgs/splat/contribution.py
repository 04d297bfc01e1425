"""How much each surfel adds to pictures: the weights that it is blended with, summed over a picture's pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor

from room2dgs.geometry.arguments import check_tensor, number
from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.splat.api import render
from room2dgs.splat.checks import check_floating
from room2dgs.splat.types import Rendering


def contributions(
    surfels: Any,
    views: Iterable[tuple[Tensor, Tensor, int, int]],
    near_m: float,
    render: Callable[..., Rendering] = render,
) -> Tensor:
    """(N,) float64, pixels: the sum of alpha times transmittance over the pixels of the view where it is largest.

    What few views see counts as much as what all see. Colour is linear in the surfels' colours, so the weights are its
    gradient: one rendering forth and back a view.

    Args:
        surfels: or another named tuple with `centers` and `sh`.
        views: K (3, 3), cam_from_world (4, 4), width, height of each.
        near_m: as `render` has it.
        render: how they are drawn, with the arguments of `splat.render`.

    Raises:
        TypeError, ValueError: as `render`.
    """
    check_floating(**surfels._asdict())
    if not surfels.centers.ndim or surfels.sh.ndim != 3:
        raise ValueError("surfels.centers is (N, 3), surfels.sh (N, K, 3)")
    most = torch.zeros(len(surfels.centers), dtype=torch.float64, device=surfels.centers.device)
    grey = torch.zeros_like(surfels.sh[:, :1]).requires_grad_()  # 0.5, far from where colours are cut off
    painted = surfels._replace(sh=grey)
    for K, cam_from_world, width, height in views:
        sized = (K, cam_from_world, width, height)
        color = render(painted, *sized, near_m=near_m, with_normal=False, with_distortion=False).color
        (gradient,) = torch.autograd.grad(color[..., 0].sum(), grey)
        most = torch.maximum(most, gradient[:, 0, 0].double() / C0)
    return most


def least_needed(contributions: Tensor, share: float) -> Tensor:
    """(N,) bool: those that add least, as many as together hold at most a share of the sum; ties by their order.

    Raises:
        TypeError, ValueError: no (N,) in floating point; no share.
    """
    check_tensor("contributions", contributions, (len(contributions) if getattr(contributions, "ndim", 0) else None,))
    number("share", share, least=0.0)
    order = torch.argsort(contributions, stable=True)
    held = torch.cumsum(contributions[order], dim=0)
    least = torch.zeros(len(order), dtype=torch.bool, device=contributions.device)
    least[order[held <= share * held[-1:]]] = True
    return least
