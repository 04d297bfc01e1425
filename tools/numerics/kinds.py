"""What a hard scene is of: surfels or 3D Gaussians, each with its kernels and its reference."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from torch import Tensor

from room2dgs import splat
from room2dgs.primitives.gaussian3d import MipGaussians
from room2dgs.splat import Gaussians, Rendering, Surfels, reference
from room2dgs.splat.gaussians import reference as gaussian_reference
from room2dgs.tools.numerics import gaussians
from room2dgs.tools.numerics.pairs import pairs_of
from room2dgs.tools.numerics.scenes import HardScene


class Kind(NamedTuple):
    """Of what a scene has.

    Attributes:
        render: the kernels, with the arguments of `splat.render`.
        reference: the same in plain torch; takes `stored` besides.
        jumps: (m,) bool of a scene's pixels: rounding may change which branch is taken.
    """

    render: Callable[..., Rendering]
    reference: Callable[..., Rendering]
    jumps: Callable[[HardScene], Tensor]


def _as_gaussians(render: Callable[..., Rendering], splats: Any, *args: Any, **options: Any) -> Rendering:
    return render(Gaussians(*splats), *args, **options)


KINDS = {
    Surfels: Kind(splat.render, reference.render, lambda scene: pairs_of(scene).jump),
    Gaussians: Kind(splat.render_gaussians, gaussian_reference.render, gaussians.jumps),
    MipGaussians: Kind(
        partial(_as_gaussians, partial(splat.render_gaussians, antialias=True)),
        partial(_as_gaussians, partial(gaussian_reference.render, antialias=True)),
        gaussians.jumps,
    ),
}


def kind_of(scene: HardScene) -> Kind:
    """Of the scene's surfels."""
    return KINDS[type(scene.surfels)]


def smooth(scene: HardScene) -> Tensor:
    """(H, W) bool: pixels that are at no jump."""
    return ~kind_of(scene).jumps(scene).reshape(scene.height, scene.width)
