"""Rendered depth against a predicted depth map, up to scale and shift."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import hardshrink

from room2dgs import _C
from room2dgs.geometry.arguments import number, whole_number
from room2dgs.kernels.builds import Build
from room2dgs.kernels.calls import call
from room2dgs.kernels.operators import has_kernels, operator
from room2dgs.losses.block_losses import empty_like, empty_sums, losses_of, plain, plain_or_none
from room2dgs.losses.checks import check_images, check_mask, check_sizes, check_step
from room2dgs.losses.known_gradients import with_gradients
from room2dgs.splat.constants import MIN_COVERED_ALPHA

LEVELS = 4  # of the kernels' differences, at most
MIN_PIXELS = 64  # fewer fix no scale and shift
MIN_SPREAD = 1e-4  # standard deviation over mean; a flatter map fixes no scale and shift
ROUNDING = 1e-6  # smaller differences of relative residuals are what float32 left of the maps: they have no sign
MIN_CORRELATION = 0.1  # of rendering and prior; below it the fitted scale is noise, or upside down


def depth_prior_loss(
    depth: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    *,
    space: str = "depth",
    align: bool = True,
    gradient_weight: float = 0.5,
    scales: int = LEVELS,
    confidence: Tensor | None = None,
    step: int = 1,
) -> Tensor:
    """L_d = mean w r^2 + gradient_weight * sum over scales of (mean w |d_x r| + mean w |d_y r|) (eq. 10).

    r = (x - (s p + t)) / m at the compared pixels, with x the rendered depth or its inverse, p the prior, and m the
    mean of s p + t, weighted by w as the fit is; where s and t are fitted that is the mean of x, so never near 0. The
    paper aligns the rendering to the prior, which makes the loss grow with the prior's unit (and it has no solution
    for a flat rendering); here the prior is aligned to the rendering, and r is relative: no unit of either map
    changes the value. s, t and m are held constant in the gradient. The gradient term is that of MiDaS: neighbours of
    r taken at strides 1, 2, 4, ..., each mean over the pairs whose two pixels are compared. Differences below a
    millionth count as none: they are rounding, and the term would push as hard by their signs as by real ones.

    float32 takes compiled kernels at up to four scales, the same bits on any number of threads.

    w is the prior's confidence; a pair of neighbours has the smaller of its two. Means are over numbers
    of pixels and not over weights: a map with low confidence everywhere counts little. s and t are fitted with the
    same weights.

    Compared are pixels that are `valid`, with a positive finite prior, a positive depth and alpha >= 0.5. With fewer
    than 64 of them the loss is 0.

    Args:
        depth: (H, W) rendered expected z-depth, metres; 0 = none.
        alpha: (H, W) rendered coverage; no gradient.
        prior: (H, W) depth or inverse depth as `space` says, in any unit; no gradient.
        valid: (H, W) bool; leave out `edge_band` of the prior.
        space: "depth" or "disparity" (inverse depth): what the prior is.
        align: fit s and t by least squares; False takes a prior that is metric already as it is (s = 1, t = 0).
        confidence: (H, W) w in 0..1, no gradient; None: 1 everywhere.
        step: prior, valid and confidence have every step-th row and column of depth and alpha, from the first.

    Returns:
        scalar, differentiable once with respect to `depth`.

    Raises:
        TypeError: a map is no tensor of the type it should have.
        ValueError: unknown `space`, maps that are empty or of different sizes, numbers that cannot be.
    """
    maps = {"depth": depth, "alpha": alpha, "prior": prior}
    check_images(**maps if confidence is None else {**maps, "confidence": confidence})
    check_mask("valid", valid)
    step, scales = check_step(step), whole_number("scales", scales)
    number("gradient_weight", gradient_weight)
    if space not in ("depth", "disparity"):
        raise ValueError(f"space={space!r} is not known; choose depth or disparity")
    of_prior = {"prior": prior, "valid": valid, "confidence": confidence}
    check_sizes({"depth": depth, "alpha": alpha}, of_prior, step)
    if has_kernels(depth, alpha, prior) and scales <= LEVELS:
        levels = scales if gradient_weight else 0
        options = (space == "disparity", align, gradient_weight, levels, step)
        value, gradient = DEPTH_PRIOR(depth, alpha, prior, valid, confidence, *options)
        return with_gradients(value, [depth], [gradient])
    depth, alpha = depth[::step, ::step], alpha[::step, ::step]
    disparity = space == "disparity"
    return _in_torch(depth, alpha, prior, valid, confidence, disparity, align, gradient_weight, scales)


def _in_torch(
    depth: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    confidence: Tensor | None,
    disparity: bool,
    align: bool,
    gradient_weight: float,
    scales: int,
) -> Tensor:
    """The same of any floating type and device, with maps of one size."""
    covered = (alpha.detach() >= MIN_COVERED_ALPHA) & (depth.detach() > 0)
    compared = valid & (prior > 0) & torch.isfinite(prior) & covered
    count = int(torch.count_nonzero(compared))
    # A depth of 1 in place of the others keeps infinities and NaN out of the gradients.
    rendered = torch.where(compared, depth, 1.0)
    weight = torch.where(compared, 1.0 if confidence is None else confidence, 0.0).to(depth.dtype)
    total_weight = float(weight.sum())
    if count < MIN_PIXELS or not total_weight > 0:
        return 0.0 * rendered.sum()
    if disparity:
        rendered = rendered.reciprocal()
    prior = torch.where(compared, prior, 0.0).to(depth.dtype)
    scale, shift = scale_and_shift(prior, rendered, weight) if align else (1.0, 0.0)
    unit = scale * float(prior.flatten().dot(weight.flatten())) / total_weight + shift
    residual = (rendered - (scale * prior + shift)) * (compared.to(depth.dtype) / unit)
    return _penalty(residual, compared, weight, count, gradient_weight, scales)


def scale_and_shift(prior: Tensor, rendered: Tensor, weight: Tensor) -> tuple[float, float]:
    """s and t that minimise the sum of weight (s prior + t - rendered)^2.

    Where they are not determined, or s would be negative, s alone: the ratio of the means, and t = 0. So it is for a
    flat prior; for a flat rendering, to which least squares would fit s = 0 and find nothing to correct; and where
    the two are as good as uncorrelated.

    Args:
        prior, rendered: (H, W), with positive means over the pixels that have a weight.
        weight: (H, W), 0 or more, or bool; where all are 0 the fit is s = 1, t = 0, and so it is for a prior of mean 0.

    Raises:
        TypeError, ValueError: maps that are no tensors in floating point, empty or of different sizes.
    """
    check_images(prior=prior, rendered=rendered)
    if isinstance(weight, Tensor) and weight.dtype == torch.bool:
        weight = weight.to(rendered.dtype)
    check_images(weight=weight)
    if not prior.shape == rendered.shape == weight.shape:
        raise ValueError("prior, rendered and weight differ in size")
    weight = weight.to(rendered.dtype).flatten()
    prior, rendered = prior.detach().to(rendered.dtype).flatten(), rendered.detach().flatten()
    count = float(weight.sum())
    if not count > 0:
        return 1.0, 0.0
    mean_prior, mean_rendered = float(prior.dot(weight)) / count, float(rendered.dot(weight)) / count
    if mean_prior == 0:
        return 1.0, 0.0
    root = weight.sqrt()
    from_mean, rendered_from_mean = (prior - mean_prior) * root, (rendered - mean_rendered) * root
    spread = (float(from_mean.dot(from_mean)) / count) ** 0.5
    rendered_spread = (float(rendered_from_mean.dot(rendered_from_mean)) / count) ** 0.5
    covariance = float(from_mean.dot(rendered_from_mean)) / count
    if (
        spread <= MIN_SPREAD * mean_prior
        or rendered_spread <= MIN_SPREAD * mean_rendered
        or covariance <= MIN_CORRELATION * spread * rendered_spread
    ):
        return mean_rendered / mean_prior, 0.0
    scale = covariance / spread**2
    return scale, mean_rendered - scale * mean_prior


def edge_band(prior: np.ndarray, relative_jump: float, width_px: int) -> np.ndarray:
    """The pixels within `width_px` of a depth edge, where predicted maps are blurred or shifted.

    An edge is where inverse depth bends from one pixel to the next two by more than `relative_jump` of its value.
    On a plane inverse depth is linear in the image, so no plane has an edge, however slanted.

    Args:
        prior: (H, W) depth, any unit; 0 or not finite = invalid, which is no edge by itself.
        relative_jump: of depth, e.g. 0.05.
        width_px: reach to each side, along rows, columns and diagonals.

    Returns:
        (H, W) bool.

    Raises:
        TypeError, ValueError: no map of numbers, or an empty one; numbers that cannot be.
    """
    prior = np.asarray(prior)
    if prior.dtype.kind not in "iuf":
        raise TypeError(f"prior is of {prior.dtype}, not numbers")
    if prior.ndim != 2 or not prior.size:
        raise ValueError(f"prior has shape {prior.shape}, not (H, W)")
    number("relative_jump", relative_jump, least=0.0)
    width_px = min(whole_number("width_px", width_px), max(prior.shape))
    present = np.isfinite(prior) & (prior > 0)
    inverse = np.zeros(prior.shape)
    np.divide(1.0, prior, out=inverse, where=present)
    edge = np.zeros(prior.shape, np.uint8)
    # the second pass sees the transposed maps: views, so that both mark the same edges
    for value, there, mark in ((inverse, present, edge), (inverse.T, present.T, edge.T)):
        before, here, after = value[:-2], value[1:-1], value[2:]
        bend = np.abs(before - 2 * here + after)
        smallest = np.minimum(np.minimum(before, here), after)
        mark[1:-1] |= there[:-2] & there[1:-1] & there[2:] & (bend > relative_jump * smallest)
    return cv2.dilate(edge, np.ones((2 * width_px + 1,) * 2, np.uint8)).astype(bool)


def _penalty(
    residual: Tensor, compared: Tensor, weight: Tensor, count: int, gradient_weight: float, scales: int
) -> Tensor:
    """Value and gradient in one sweep: autograd's own backward through the slices takes twice as long."""
    r_all = residual.detach()
    weighted = r_all * weight
    value = (weighted * r_all).sum() / count
    gradient = weighted * (2 / count)
    levels = min(scales, max(residual.shape).bit_length())  # the rest have no pairs
    for level in range(levels if gradient_weight else 0):
        r, m, w, g = (t[:: 2**level, :: 2**level] for t in (r_all, compared, weight, gradient))
        for along, used, confidence, push in ((r, m, w, g), (r.T, m.T, w.T, g.T)):
            share = gradient_weight / max(1, int(torch.count_nonzero(used[1:] & used[:-1])))
            smaller = torch.minimum(confidence[1:], confidence[:-1])  # 0 where one of the two is not compared
            difference = hardshrink(along[1:] - along[:-1], ROUNDING).mul_(smaller)
            value += share * difference.abs().sum()
            sign = difference.sign_().mul_(smaller).mul_(share)
            push[1:] += sign
            push[:-1] -= sign
    return with_gradients(value, [residual], [gradient], again=True)


def _on_cpu(
    depth: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    confidence: Tensor | None,
    disparity: bool,
    align: bool,
    gradient_weight: float,
    levels: int,
    step: int,
) -> tuple[Tensor, Tensor]:
    maps = (*map(plain, (depth, alpha, prior)), *map(plain_or_none, (valid, confidence)))
    gradient = empty_like(depth)
    value = call(_C.depth_prior, *maps, disparity, align, gradient_weight, levels, step, gradient)
    return depth.new_tensor(value), gradient


def _by_block_code(
    build: Build,
    depth: Tensor,
    alpha: Tensor,
    prior: Tensor,
    valid: Tensor,
    confidence: Tensor | None,
    disparity: bool,
    align: bool,
    gradient_weight: float,
    levels: int,
    step: int,
) -> tuple[Tensor, Tensor]:
    losses, queue = losses_of(build, depth)
    compared = depth[::step, ::step]
    maps = map(plain, (compared, alpha[::step, ::step], prior))
    gradient, value = empty_like(compared), empty_sums(depth, 1)
    call(
        losses.depth_prior, *maps, plain_or_none(valid), plain_or_none(confidence), disparity, align, gradient_weight,
        levels, gradient, value, queue,
    )  # fmt: skip
    if step > 1:
        compared = gradient
        gradient = torch.zeros_like(depth)
        gradient[::step, ::step] = compared
    return value[0].to(depth.dtype), gradient


DEPTH_PRIOR = operator(
    "depth_prior(Tensor depth, Tensor alpha, Tensor prior, Tensor valid, Tensor? confidence, bool disparity, "
    "bool align, float gradient_weight, int levels, int step) -> (Tensor, Tensor)",
    _by_block_code,
    _on_cpu,
)
