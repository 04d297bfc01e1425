"""`rasterization_2dgs`: the renderer under the argument names and shapes of gsplat's function of that name."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.depth_maps import depth_to_normals
from room2dgs.splat.api import render
from room2dgs.splat.checks import check_far, check_near
from room2dgs.splat.footprint import Footprint, footprint
from room2dgs.splat.gsplat_arguments import RENDER_MODES, TILE, among, checked, draw_colors, hidden, refuse
from room2dgs.splat.types import Rendering, Surfels


def rasterization_2dgs(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor,
    viewmats: Tensor,
    Ks: Tensor,
    width: int,
    height: int,
    near_plane: float = 0.01,
    far_plane: float = 1e10,
    radius_clip: float = 0.0,
    eps2d: float = 0.3,
    sh_degree: int | None = None,
    packed: bool = False,
    tile_size: int = TILE,
    backgrounds: Tensor | None = None,
    render_mode: str = "RGB",
    sparse_grad: bool = False,
    absgrad: bool = False,
    distloss: bool = False,
    depth_mode: str = "expected",
) -> tuple[Tensor, Tensor, Tensor, Tensor | None, Tensor, Tensor, dict[str, Any]]:
    """Render surfels into C views, and that for every element of the batch dimensions `...`, one after another.

    Differentiable with respect to all tensors, Ks included. What differs from gsplat 1.5: depth is where the ray meets
    the disc, not that of its centre; the distortion is the quadratic one of the 2DGS paper; parts of a disc nearer than
    the near plane are cut off.

    Args:
        means: (..., N, 3) metres, world frame.
        quats: (..., N, 4) as (w, x, y, z), any norm above 0.
        scales: (..., N, 2) or (..., N, 3); a third column has no meaning for a disc.
        opacities: (..., N) in (0, 1).
        colors: with `sh_degree` coefficients (..., [C,] N, K, 3), else values (..., [C,] N, D) for any D.
        viewmats: (..., C, 4, 4) world to camera.
        Ks: (..., C, 3, 3) pixels, centres at +0.5.
        width, height: pixels.
        near_plane, far_plane: metres; surfels with centres outside are not drawn.
        sh_degree: degree to use, at most that of `colors`.
        tile_size: has no influence on the images; the kernels have their own.
        backgrounds: (..., C, D), zeros by default.
        render_mode: "RGB", "D" (accumulated depth), "ED" (expected depth), "RGB+D", "RGB+ED".
        distloss: draw the distortion; else it is zeros.
        depth_mode: the depth, "expected" or "median", that `surf_normals` come from.
        radius_clip, eps2d, packed, sparse_grad, absgrad: gsplat's defaults alone.

    Returns:
        render_colors (..., C, H, W, X), X = D, 1 or D + 1 by the mode; render_alphas (..., C, H, W, 1);
        render_normals (..., C, H, W, 3), world frame, facing the camera, weighted sums;
        surf_normals (..., C, H, W, 3) of the depth, for the modes "RGB+D" and "RGB+ED", else None;
        render_distort and render_median (..., C, H, W, 1);
        meta: `means2d`, `depths`, `radii` (0: not seen), `opacities` of every camera and surfel, without gradients;
        `gradient_2dgs` (..., C, N, 2), whose `.grad` after a backward pass is that of the projected centres, 1/pixel;
        `render_distort`, `camera_ids` and `gaussian_ids` (None), `width`, `height`, `tile_size`, `n_cameras`,
        `n_batches`.

    Raises:
        NotImplementedError: an option that this renderer does not have.
        TypeError: lists or arrays where tensors belong.
        ValueError: shapes, types or values that do not fit.
    """
    refuse(
        radius_clip=(radius_clip, 0.0), eps2d=(eps2d, 0.3), packed=(packed, False),
        sparse_grad=(sparse_grad, False), absgrad=(absgrad, False),
    )  # fmt: skip
    among("render_mode", render_mode, RENDER_MODES)
    among("depth_mode", depth_mode, ("expected", "median"))
    if tile_size < 1:
        raise ValueError(f"tile_size is {tile_size}")
    check_near(near_plane)
    check_far("far_plane", far_plane, near_plane)
    scales = scales[..., :2] if isinstance(scales, Tensor) and scales.ndim and scales.shape[-1] == 3 else scales
    scene = checked(means, quats, scales, opacities, colors, viewmats, Ks, backgrounds, sh_degree, 2)
    batch, C, N = scene.batch, scene.cameras, means.shape[-2]

    gradient_2dgs = means.new_zeros(*batch, C, N, 2).requires_grad_(torch.is_grad_enabled())
    drawn: list[tuple[Rendering, Tensor]] = []
    footprints: list[Footprint] = []
    for index in scene.indices:
        one = index[:-1]  # the element of the batch
        surfels = Surfels(means[one], quats[one], scales[one], opacities[one], means.new_zeros(N, 1, 3))
        view = _DrawOptions(
            Ks[index], viewmats[index], width, height, near_plane, far_plane, gradient_2dgs[index], distloss
        )
        values = scene.colors[index] if "RGB" in render_mode else None
        footprints.append(_footprint(surfels, view))
        drawn.append(_draw_view(surfels, values, scene.backgrounds[index], sh_degree, view, footprints[-1]))

    stacked, firsts = scene.stacked, [rendering for rendering, _ in drawn]
    surf_normals = None
    if render_mode in ("RGB+D", "RGB+ED"):
        depths = [r.depth if depth_mode == "expected" else r.median_depth for r in firsts]
        pairs = zip(depths, scene.indices, strict=True)
        surf_normals = stacked([depth_to_normals(depth, Ks[index], viewmats[index]) for depth, index in pairs])
    distort = stacked([r.distortion for r in firsts])[..., None]
    meta = {
        "camera_ids": None, "gaussian_ids": None,
        "means2d": stacked([p.center_px for p in footprints]), "depths": stacked([p.depth for p in footprints]),
        "radii": stacked([p.radius_px for p in footprints]),
        "opacities": opacities.detach()[..., None, :].expand(*batch, C, N),
        "gradient_2dgs": gradient_2dgs, "render_distort": distort,
        **scene.sizes(width, height),
    }  # fmt: skip
    return (
        scene.images(render_mode, drawn),
        stacked([r.alpha for r in firsts])[..., None],
        stacked([r.normal for r in firsts]),
        surf_normals,
        distort,
        stacked([r.median_depth for r in firsts])[..., None],
        meta,
    )


class _DrawOptions(NamedTuple):
    """One camera and how it is drawn; see `rasterization_2dgs`."""

    K: Tensor
    cam_from_world: Tensor
    width: int
    height: int
    near_plane: float
    far_plane: float
    center_px: Tensor
    distloss: bool


def _footprint(surfels: Surfels, view: _DrawOptions) -> Footprint:
    like = surfels.centers.dtype
    K, pose = view.K.to(like), view.cam_from_world.to(like)
    return footprint(surfels, K, pose, view.width, view.height, view.near_plane, view.far_plane)


def _draw_view(
    surfels: Surfels,
    values: Tensor | None,
    background: Tensor,
    sh_degree: int | None,
    view: _DrawOptions,
    where: Footprint,
) -> tuple[Rendering, Tensor]:
    """One view's rendering and colours, of values (N, D) or coefficients (N, K, 3), or None where none are wanted."""
    surfels = hidden(surfels, where.depth > view.far_plane)

    def draw(sh: Tensor, behind: Tensor, first: bool) -> Rendering:
        return render(
            surfels._replace(sh=sh), view.K, view.cam_from_world, view.width, view.height, background=behind,
            near_m=view.near_plane, center_px=view.center_px, with_normal=first,
            with_distortion=first and view.distloss,
        )  # fmt: skip

    return draw_colors(draw, values, sh_degree, background, len(surfels.centers))
