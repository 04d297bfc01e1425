"""What a rasterizer of surfels offers: the interface that `splat.render` calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.splat.types import Rendering, Surfels


class View(NamedTuple):
    """What is asked of a backend beside the surfels; shapes and devices are checked (`checks.check_shapes`).

    Attributes:
        K: (3, 3) intrinsics in pixels, centres at +0.5.
        cam_from_world: (4, 4) pose, metres.
        width, height: pixels.
        background: (3,) RGB.
        near_m: metres.
        opacity_floor: fainter hits are skipped.
        center_px: (N, 2) zeros whose gradient is wanted, or None.
        with_normal, with_distortion: outputs that may be zeros when they are not wanted.
    """

    K: Tensor
    cam_from_world: Tensor
    width: int
    height: int
    background: Tensor
    near_m: float
    opacity_floor: float
    center_px: Tensor | None
    with_normal: bool
    with_distortion: bool


class Backend(NamedTuple):
    """One way to render.

    Attributes:
        name: what `splat.render(backend=...)` is given.
        devices: device types that it renders on, or None for any.
        dtypes: types of the surfels that it takes, or None for any floating one.
        render: differentiable with respect to every tensor of the surfels and the view; refuses values by
            `checks.check_values`, since only it sees them when `torch.compile` has traced the call.
        automatic: chosen for its devices when the caller names none.
        missing: why it cannot be used in this build, and what to do; None where it can.
    """

    name: str
    devices: tuple[str, ...] | None
    dtypes: tuple[torch.dtype, ...] | None
    render: Callable[[Surfels, View], Rendering]
    automatic: bool = True
    missing: str | None = None
