"""`rasterization`: 3D Gaussians under the argument names and shapes of gsplat's function of that name."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.arguments import number
from room2dgs.splat.checks import check_far, check_filter, check_near
from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.splat.gaussians.api import render
from room2dgs.splat.gaussians.reference import project
from room2dgs.splat.gsplat_arguments import RENDER_MODES, Scene, among, checked, draw_colors, hidden, refuse
from room2dgs.splat.types import Gaussians, Rendering

MODES = ("classic", "antialiased")
MORE = MappingProxyType({"return_normals": False, "global_z_order": True})  # gsplat's defaults that are not None


class _Where(NamedTuple):
    """Gaussians on one screen, without gradients: what gsplat's projection gives."""

    means2d: Tensor  # (N, 2)
    depths: Tensor  # (N,)
    radii: Tensor  # (N, 2) int32, 0: not seen
    conics: Tensor  # (N, 3)
    opacities: Tensor  # (N,) after compensation


class _Camera(NamedTuple):
    K: Tensor
    cam_from_world: Tensor
    background: Tensor
    width: int
    height: int
    near_plane: float
    far_plane: float
    radius_clip: float
    eps2d: float
    antialias: bool


def rasterization(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor | None,
    viewmats: Tensor,
    Ks: Tensor,
    width: int,
    height: int,
    near_plane: float = 0.01,
    far_plane: float = 1e10,
    radius_clip: float = 0.0,
    eps2d: float = 0.3,
    sh_degree: int | None = None,
    packed: bool = True,
    tile_size: int | None = None,
    backgrounds: Tensor | None = None,
    render_mode: str = "RGB",
    sparse_grad: bool = False,
    absgrad: bool = False,
    rasterize_mode: str = "classic",
    channel_chunk: int = 32,
    distributed: bool = False,
    camera_model: str = "pinhole",
    segmented: bool = False,
    covars: Tensor | None = None,
    with_ut: bool = False,
    with_eval3d: bool = False,
    **more: Any,
) -> tuple[Tensor, Tensor, dict[str, Any]]:
    """Render 3D Gaussians into C views, and that for every element of the batch dimensions `...`, one after another.

    Differentiable with respect to all tensors, Ks included. It takes the calls of gsplat's example trainer and gives
    its default strategy what that reads; its MCMC strategy calls CUDA functions of gsplat's own. What differs from
    gsplat 1.6: depth is where the Gaussian is densest along the ray, not that of its centre; an ellipse ends where its
    own opacity falls below 1/255; gradients are dense; the meta has no lists of tiles.

    Args:
        means: (..., N, 3) metres, world frame.
        quats: (..., N, 4) as (w, x, y, z), any norm above 0.
        scales: (..., N, 3).
        opacities: (..., N) in (0, 1).
        colors: with `sh_degree` coefficients (..., [C,] N, K, 3), else values (..., [C,] N, D) for any D; None for the
            modes without colour.
        viewmats: (..., C, 4, 4) world to camera.
        Ks: (..., C, 3, 3) pixels, centres at +0.5.
        width, height: pixels.
        near_plane, far_plane: metres; Gaussians with centres outside are not drawn.
        radius_clip: pixels; Gaussians that reach no further than this are not drawn.
        eps2d: variance of the pixel's filter, 0.01 to 1 px^2.
        sh_degree: degree to use, at most that of `colors`.
        packed: the meta has the Gaussians that are seen alone.
        tile_size, channel_chunk, segmented, sparse_grad: have no influence.
        backgrounds: (..., C, D), zeros by default.
        render_mode: "RGB", "D" (accumulated depth), "ED" (expected depth), "RGB+D", "RGB+ED".
        rasterize_mode: "antialiased" lowers opacity by what the filter adds to the area.
        absgrad, distributed, camera_model, covars, with_ut, with_eval3d, and what gsplat has besides: gsplat's
            defaults alone.

    Returns:
        render_colors (..., C, H, W, X), X = D, 1 or D + 1 by the mode; render_alphas (..., C, H, W, 1);
        meta: `means2d`, whose `.grad` after a backward pass is that of the projected centres, `radii`, `depths`,
        `conics`, `opacities`: (..., C, N, ...) each, radii 0 where a Gaussian is not seen; packed (M, ...) with
        `batch_ids`, `camera_ids` and `gaussian_ids` (M,), which are None otherwise; `width`, `height`, `tile_size`,
        `n_cameras`, `n_batches`.

    Raises:
        NotImplementedError: an option that this renderer does not have.
        TypeError: lists or arrays where tensors belong.
        ValueError: shapes, types or values that do not fit.
    """
    refuse(
        absgrad=(absgrad, False), distributed=(distributed, False), camera_model=(camera_model, "pinhole"),
        covars=(covars, None), with_ut=(with_ut, False), with_eval3d=(with_eval3d, False),
        **{name: (value, MORE.get(name)) for name, value in more.items()},
    )  # fmt: skip
    among("render_mode", render_mode, RENDER_MODES)
    among("rasterize_mode", rasterize_mode, MODES)
    check_near(near_plane)
    check_far("far_plane", far_plane, near_plane)
    check_filter("eps2d", eps2d)
    number("radius_clip", radius_clip, least=0.0)
    if colors is None:
        if "RGB" in render_mode:
            raise TypeError(f"colors is None, which render_mode {render_mode!r} does not draw")
        colors, sh_degree = torch.zeros_like(opacities)[..., None], None
    scene = checked(means, quats, scales, opacities, colors, viewmats, Ks, backgrounds, sh_degree, 3)
    cameras = [
        _Camera(
            Ks[index], viewmats[index], scene.backgrounds[index], width, height, near_plane, far_plane, radius_clip,
            eps2d, rasterize_mode == "antialiased",
        )
        for index in scene.indices
    ]  # fmt: skip
    gaussians = [
        Gaussians(means[one], quats[one], scales[one], opacities[one], means.new_zeros(means.shape[-2], 1, 3))
        for one in (index[:-1] for index in scene.indices)
    ]
    places = [_where(*pair) for pair in zip(gaussians, cameras, strict=True)]
    meta, shifts = _meta(places, scene, packed)
    drawn = [
        _draw(one, scene.colors[index] if "RGB" in render_mode else None, sh_degree, camera, where, shift)
        for one, index, camera, where, shift in zip(gaussians, scene.indices, cameras, places, shifts, strict=True)
    ]
    alphas = scene.stacked([rendering.alpha for rendering, _ in drawn])[..., None]
    return scene.images(render_mode, drawn), alphas, {**meta, **scene.sizes(width, height)}


class _GradientOf(torch.autograd.Function):
    """Zeros, whose gradient is passed on: pixels' gradients reach `means2d`, which moves nothing."""

    @staticmethod
    def forward(ctx, values: Tensor) -> Tensor:
        return torch.zeros_like(values)

    @staticmethod
    def backward(ctx, *gradients: Tensor) -> Tensor:
        return gradients[0]


def _meta(places: list[_Where], scene: Scene, packed: bool) -> tuple[dict[str, Any], list[Tensor]]:
    """What gsplat gives beside the images, and each view's zeros for the gradient of its projected centres."""
    whole, C = _Where(*(torch.stack(x) for x in zip(*places, strict=True))), scene.cameras
    if not packed:
        meta = {name: x.reshape(*scene.batch, C, *x.shape[1:]) for name, x in whole._asdict().items()}
        meta["means2d"].requires_grad_(torch.is_grad_enabled())
        shifts = _GradientOf.apply(meta["means2d"]).reshape(len(places), -1, 2)
        ids: dict[str, Any] = {"batch_ids": None, "camera_ids": None, "gaussian_ids": None}
        return {**meta, **ids}, list(shifts)
    seen = (whole.radii > 0).all(-1)
    views, rows = seen.nonzero().unbind(1)
    meta = {name: x[seen] for name, x in whole._asdict().items()}
    meta["means2d"].requires_grad_(torch.is_grad_enabled())
    zeros = torch.zeros_like(whole.means2d)
    shifts = zeros.index_put((views, rows), _GradientOf.apply(meta["means2d"]))
    ids = {"batch_ids": views // C, "camera_ids": views % C, "gaussian_ids": rows}
    return {**meta, **ids}, list(shifts)


@torch.no_grad()
def _where(gaussians: Gaussians, camera: _Camera) -> _Where:
    K, pose = camera.K.to(gaussians.centers), camera.cam_from_world.to(gaussians.centers)
    p = project(
        gaussians, K, pose, camera.width, camera.height, camera.near_plane, None, camera.eps2d, camera.antialias
    )
    factor = torch.stack([p.a_u, p.a_v], dim=1)
    precision = factor.transpose(1, 2) @ factor
    conics = torch.stack([precision[:, 0, 0], precision[:, 0, 1], precision[:, 1, 1]], dim=1)
    det = (p.a_u[:, 0] * p.a_v[:, 1]).square()
    variances = conics[:, [2, 0]] / det[:, None]
    reach = 2 * torch.log((p.opacity / OPACITY_FLOOR).clamp_min(1))
    radii = (reach[:, None] * variances).sqrt().ceil().clamp(1, 1e6)
    size = K.new_tensor([camera.width, camera.height])
    on_screen = ((p.center_px + radii > 0) & (p.center_px - radii < size)).all(-1)
    seen = p.visible & on_screen & (p.opacity >= OPACITY_FLOOR) & (p.depth <= camera.far_plane)
    if camera.radius_clip > 0:
        seen &= radii.amax(-1) > camera.radius_clip
    radii = torch.where(seen[:, None], radii, torch.zeros_like(radii)).to(torch.int32)
    return _Where(p.center_px, p.depth, radii, conics, p.opacity)


def _draw(
    gaussians: Gaussians, values: Tensor | None, sh_degree: int | None, camera: _Camera, where: _Where, shift: Tensor
) -> tuple[Rendering, Tensor]:
    """The rendering, and the colours of it: of values (N, D) or coefficients (N, K, 3), or None for no colour."""
    left_out = where.depths > camera.far_plane
    if camera.radius_clip > 0:
        left_out |= ~(where.radii > 0).all(-1)
    gaussians = hidden(gaussians, left_out)

    def draw(sh: Tensor, behind: Tensor, first: bool) -> Rendering:
        return render(
            gaussians._replace(sh=sh), camera.K, camera.cam_from_world, camera.width, camera.height,
            background=behind, near_m=camera.near_plane, center_px=shift, with_normal=False, with_distortion=False,
            antialias=camera.antialias, filter_px2=camera.eps2d,
        )  # fmt: skip

    return draw_colors(draw, values, sh_degree, camera.background, len(gaussians.centers))
