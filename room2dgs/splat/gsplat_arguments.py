"""What the two functions with gsplat's arguments have in common: checks, colours of cameras, values of any number."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.splat.checks import check_floating
from room2dgs.splat.constants import SH_DEGREE_OF
from room2dgs.splat.types import Gaussians, Rendering, Surfels

RENDER_MODES = ("RGB", "D", "ED", "RGB+D", "RGB+ED")
TILE = 16

Draw = Callable[[Tensor, Tensor, bool], Rendering]  # of coefficients and a background; is it the view's first?


class Scene(NamedTuple):
    """What fits together: the batch dimensions and cameras, colours of each camera, and a background for each."""

    batch: torch.Size
    cameras: int
    colors: Tensor
    backgrounds: Tensor

    @property
    def indices(self) -> list[tuple[int, ...]]:
        """Of all views, in their order: the element of the batch and the camera."""
        return list(product(*map(range, (*self.batch, self.cameras))))

    def stacked(self, images: Sequence[Tensor]) -> Tensor:
        """(..., C, *shape) of one tensor a view."""
        return torch.stack(list(images)).reshape(*self.batch, self.cameras, *images[0].shape)

    def images(self, mode: str, drawn: Sequence[tuple[Rendering, Tensor]]) -> Tensor:
        """What a render mode asks for, of each view's rendering and colours."""
        images = [self.stacked([color for _, color in drawn])] if "RGB" in mode else []
        if mode.endswith("ED"):
            images.append(self.stacked([r.depth for r, _ in drawn])[..., None])
        elif mode.endswith("D"):
            images.append(self.stacked([r.depth * r.alpha for r, _ in drawn])[..., None])
        return torch.cat(images, dim=-1)

    def sizes(self, width: int, height: int) -> dict[str, int]:
        """The same for the meta of both functions."""
        return {
            "width": width, "height": height, "tile_size": TILE, "n_cameras": self.cameras,
            "n_batches": self.batch.numel(),
        }  # fmt: skip


def checked(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor,
    viewmats: Tensor,
    Ks: Tensor,
    backgrounds: Tensor | None,
    sh_degree: int | None,
    scale_count: int,
) -> Scene:
    """The arguments of `rasterization` and `rasterization_2dgs`; `scale_count` of a splat.

    Raises:
        TypeError, ValueError: as these say.
    """
    check_floating(
        means=means, quats=quats, scales=scales, opacities=opacities, colors=colors,
        **{} if backgrounds is None else {"backgrounds": backgrounds},
    )  # fmt: skip
    check_floating(viewmats=viewmats)
    check_floating(Ks=Ks)
    if means.ndim < 2 or scales.ndim < 2 or viewmats.ndim < 3:
        raise ValueError(f"means is (..., N, 3), scales (..., N, {scale_count}), viewmats (..., C, 4, 4)")
    batch, N, C = means.shape[:-2], means.shape[-2], viewmats.shape[-3]
    colors = colors_of_cameras(colors, (*batch, C, N), sh_degree)
    channels = 3 if sh_degree is not None else colors.shape[-1]
    if backgrounds is None:
        backgrounds = means.new_zeros(*batch, C, channels)
    shapes: dict[str, tuple[Tensor, tuple[int, ...]]] = {
        "means": (means, (N, 3)), "quats": (quats, (N, 4)), "scales": (scales, (N, scale_count)),
        "opacities": (opacities, (N,)),
        "viewmats": (viewmats, (C, 4, 4)), "Ks": (Ks, (C, 3, 3)), "backgrounds": (backgrounds, (C, channels)),
    }  # fmt: skip
    for name, (tensor, shape) in shapes.items():
        if tuple(tensor.shape) != (*batch, *shape):
            raise ValueError(f"{name} has shape {tuple(tensor.shape)}, not {(*batch, *shape)}")
    if not C or not batch.numel():
        raise ValueError("there is no camera to draw for")
    return Scene(batch, C, colors, backgrounds)


def hidden(splats: Surfels | Gaussians, which: Tensor) -> Any:
    """The same, of which some (N,) draw nothing and get no gradient."""
    if not which.any():
        return splats
    return splats._replace(opacities=torch.where(which, 0.0, splats.opacities))


def draw_colors(
    draw: Draw, values: Tensor | None, sh_degree: int | None, background: Tensor, count: int
) -> tuple[Rendering, Tensor]:
    """A view's rendering, and the colours of it.

    Args:
        values: (N, D), or with `sh_degree` coefficients (N, K, 3); None: no colour is wanted.
        count: N.
    """
    if values is None:
        rendering = draw(background.new_zeros(count, 1, 3), background.new_zeros(3), True)
    elif sh_degree is None:
        return _draw_values(draw, values, background)
    else:
        rendering = draw(values, background, True)
    return rendering, rendering.color


def _draw_values(draw: Draw, values: Tensor, background: Tensor) -> tuple[Rendering, Tensor]:
    """Values (N, D) over a background (D,), three channels a rendering; gives the first one and (H, W, D).

    The renderer clamps colours at 0, and the gradient with them, so values are lifted clear of it and the image is
    lowered again: sum w (c - l) + l sum w.
    """
    count, channels = values.shape
    lift = (values.detach().amin(0) - 0.5).clamp(max=0.0) if count else values.new_zeros(channels)
    first: Rendering | None = None
    parts = []
    for begin in range(0, channels, 3):
        used = min(3, channels - begin)
        sh = values.new_zeros(count, 1, 3)
        sh[:, 0, :used] = (values[:, begin : begin + used] - lift[begin : begin + used] - 0.5) / C0
        behind = torch.nn.functional.pad(background[begin : begin + used], (0, 3 - used))
        rendering = draw(sh, behind, first is None)
        first = first or rendering
        parts.append(rendering.color[..., :used] + lift[begin : begin + used] * rendering.alpha[..., None])
    assert first is not None  # there is a channel: `colors_of_cameras`
    return first, torch.cat(parts, dim=-1)


def colors_of_cameras(colors: Tensor, cameras: tuple[int, ...], sh_degree: int | None) -> Tensor:
    """(..., C, N, D), or (..., C, N, K, 3) with just the coefficients of `sh_degree`."""
    *batch, C, _ = cameras
    tail = 1 if sh_degree is None else 2
    if colors.ndim == len(batch) + 1 + tail:
        colors = colors.unsqueeze(len(batch))
        colors = colors.expand(*colors.shape[: len(batch)], C, *colors.shape[len(batch) + 1 :])
    shape = tuple(colors.shape)
    if len(shape) != len(cameras) + tail or shape[: len(cameras)] != cameras:
        raise ValueError(f"colors has shape {shape}, which does not fit {tuple(cameras)} surfels of each camera")
    if sh_degree is None:
        if shape[-1] < 1:
            raise ValueError("colors has no channel")
        return colors
    if sh_degree not in SH_DEGREE_OF.values() or shape[-1] != 3 or shape[-2] < (sh_degree + 1) ** 2:
        raise ValueError(f"sh_degree {sh_degree} does not fit coefficients of shape {shape[-2:]}; degrees are 0 to 3")
    return colors[..., : (sh_degree + 1) ** 2, :]


def among(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ValueError(f"{name} is {value!r}, not one of {', '.join(known)}")


def refuse(**options: tuple[Any, Any]) -> None:
    for name, (value, only) in options.items():
        if value != only:
            raise NotImplementedError(f"{name}={value!r} is not supported by this renderer; leave it at {only!r}")
