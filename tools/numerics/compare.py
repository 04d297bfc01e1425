"""The rasterizer's kernels against the float64 reference, on one hard scene: images and every gradient."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs.splat import Rendering, Surfels, reference
from room2dgs.tools.numerics.kinds import kind_of, smooth
from room2dgs.tools.numerics.scenes import NEAR_M, HardScene

TOLERANCE = 1e-4
ARITHMETIC = 4.0  # roundings of a hit's arithmetic, for one of what is stored
ROUNDING = 2.0**-24  # relative, of float32
DRAWS = 2
BACKGROUND = (0.1, 0.4, 0.7)
GRADIENTS = (*Surfels._fields, "K", "cam_from_world", "background", "center_px")
NAMES = (*Rendering._fields, *GRADIENTS)
NOTHING = 1e-9  # an absolute error that is no error, of tensors that are all but zero
POWERS = (0, 0, 1, 1, 0, -2)  # of length in each image of a `Rendering`
WINDOW = (64, 48)  # pixels, of a large image


class Comparison(NamedTuple):
    """Worst relative errors |a - b| / (|b| + root mean square of b) over pixels at no jump.

    Attributes:
        images: name of an image -> error.
        gradients: name of an input -> error.
        left_out: share of the pixels beside a jump.
        bounds: of each of these: 1e-4; or, where that is more, 4 times what the float64 reference's own results change
            by when each of a surfel's numbers is off by one rounding of float32: the condition of the scene.
        finite: everything is, also beside jumps.
    """

    images: dict[str, float]
    gradients: dict[str, float]
    left_out: float
    bounds: dict[str, float]
    finite: bool

    @property
    def bound(self) -> float:
        """The largest."""
        return max(self.bounds.values())

    @property
    def passed(self) -> bool:
        errors = {**self.images, **self.gradients}
        return self.finite and all(error <= self.bounds[name] for name, error in errors.items())


def relative_error(actual: Tensor, expected: Tensor, nothing: float = NOTHING) -> float:
    """max |a - b| / (|b| + rms b); infinite where `actual` is not finite."""
    if not expected.numel():
        return 0.0
    if not torch.isfinite(actual).all():
        return float("inf")
    expected = expected.double()
    error = (actual.double() - expected).abs()
    if error.max() <= nothing:
        return 0.0
    largest = expected.abs().max().clamp_min(1e-300)  # squares of tiny and of huge numbers
    rms = (expected / largest).square().mean().sqrt() * largest
    return (error / (expected.abs() + rms)).max().item()


def image_weights(width: int, height: int, seed: int = 1, unit: float = 1.0) -> list[Tensor]:
    """A random gradient for every image of a `Rendering`, so that their sum has no unit.

    Args:
        unit: of the scene's lengths, in a metre.
    """
    g = torch.Generator().manual_seed(seed)
    flat, three = (height, width), (height, width, 3)
    shapes = zip((three, flat, flat, flat, three, flat), POWERS, strict=True)
    return [torch.randn(shape, generator=g) * unit**-power for shape, power in shapes]


def differentiate(
    render: Callable[..., Rendering], scene: HardScene, weights: list[Tensor], dtype: torch.dtype
) -> tuple[Rendering, dict[str, Tensor]]:
    """Images, and the gradient of their weighted sum to every input; the pose stays float64."""
    surfels = type(scene.surfels)(*(x.to(dtype, copy=True).requires_grad_() for x in scene.surfels))
    K, background = (x.to(dtype, copy=True).requires_grad_() for x in (scene.K, torch.tensor(BACKGROUND)))
    pose = scene.cam_from_world.clone().requires_grad_()
    center_px = torch.zeros(len(surfels.centers), 2, dtype=dtype, requires_grad=True)
    images = render(
        surfels, K, pose, scene.width, scene.height, background=background, center_px=center_px,
        near_m=scene.near_m, opacity_floor=scene.opacity_floor,
    )  # fmt: skip
    total: Any = sum((w.to(x.dtype) * x).sum() for w, x in zip(weights, images, strict=True))
    inputs = [*surfels, K, pose, background, center_px]
    gradients = torch.autograd.grad(total, inputs, allow_unused=True, materialize_grads=True)
    return Rendering(*(x.detach() for x in images)), dict(zip(GRADIENTS, gradients, strict=True))


def perturbed(p: Any, seed: int) -> Any:
    """A surfel's numbers, each off by one rounding of float32 up or down; of the centre, by that of a pixel's place."""
    g = torch.Generator().manual_seed(seed)

    def signs(x: Tensor) -> Tensor:
        return ROUNDING * (2 * torch.randint(0, 2, x.shape, generator=g) - 1)

    center = p.center_px + signs(p.center_px) * (p.center_px.detach().abs() + reference.TILE)
    numbers = {name: getattr(p, name) for name in ("depth", "a_u", "a_v", "b", "opacity", "color", "normal")}
    return p._replace(center_px=center, **{name: x * (1 + signs(x)) for name, x in numbers.items()})


def condition(
    scene: HardScene, weights: list[Tensor], expected: Rendering, to_expect: dict[str, Tensor], kept: Tensor
) -> dict[str, float]:
    """By how much each of the float64 reference's results changes when its numbers are `perturbed`: relative errors."""
    worst = dict.fromkeys(NAMES, 0.0)
    for seed in range(DRAWS):
        render = partial(kind_of(scene).reference, stored=partial(perturbed, seed=seed))
        images, gradients = differentiate(render, scene, weights, torch.float64)
        for name, error in (_image_errors(images, expected, kept) | _gradient_errors(gradients, to_expect)).items():
            worst[name] = max(worst[name], error)
    return worst


def compare(scene: HardScene, conditioned: bool = True, render: Callable[..., Rendering] | None = None) -> Comparison:
    """Kernels and reference on one scene.

    Args:
        render: with the arguments of `splat.render`; None: the scene's own kernels.
        conditioned: what float32 cannot hold may be off by more than 1e-4, see `Comparison.bounds`.
    """
    render = render or kind_of(scene).render
    kept = smooth(scene)
    everywhere = image_weights(scene.width, scene.height, unit=scene.near_m / NEAR_M)
    weights = [w * (kept[..., None] if w.ndim == 3 else kept) for w in everywhere]
    expected, to_expect = differentiate(kind_of(scene).reference, scene, weights, torch.float64)
    actual, gradients = differentiate(render, scene, weights, torch.float32)
    # beside a jump either side may be taken, but nothing may break
    beside, to_all = differentiate(render, scene, everywhere, torch.float32)
    bounds = dict.fromkeys(NAMES, TOLERANCE)
    if conditioned:
        changes = condition(scene, weights, expected, to_expect, kept)
        bounds = {name: max(TOLERANCE, ARITHMETIC * change) for name, change in changes.items()}
    return Comparison(
        _image_errors(actual, expected, kept),
        _gradient_errors(gradients, to_expect),
        1 - kept.float().mean().item(),
        bounds,
        all(torch.isfinite(x).all() for x in (*beside, *to_all.values())),
    )


def _image_errors(actual: Rendering, expected: Rendering, kept: Tensor) -> dict[str, float]:
    pairs = zip(expected._fields, actual, expected, strict=True)
    return {name: relative_error(a[kept], b[kept]) for name, a, b in pairs}


def _gradient_errors(actual: dict[str, Tensor], expected: dict[str, Tensor]) -> dict[str, float]:
    return {name: relative_error(actual[name], expected[name]) for name in GRADIENTS}


def large(scene: HardScene) -> Comparison:
    """Likewise for an image too large for the reference: in windows in its corners and its middle.

    A window of the reference is an image of its own, with the principal point shifted.
    """
    w, h = WINDOW
    middle = ((scene.width - w) // 2, (scene.height - h) // 2)
    corners = [(x, y) for x in (0, scene.width - w) for y in (0, scene.height - h)]
    weights = [torch.zeros(s) for s in ((scene.height, scene.width, 3), (scene.height, scene.width))]
    weights = [weights[1 if k in (1, 2, 3, 5) else 0].clone() for k in range(6)]
    expected: list[Any] = []
    to_expect: dict[str, Tensor] = {}
    places = []
    for index, (x, y) in enumerate([middle, *corners]):
        K = scene.K.clone()
        K[0, 2] -= x
        K[1, 2] -= y
        part = scene._replace(K=K, width=w, height=h)
        kept = smooth(part)
        here = [g * (kept[..., None] if g.ndim == 3 else kept) for g in image_weights(w, h, index)]
        images, gradients = differentiate(kind_of(part).reference, part, here, torch.float64)
        for whole, g in zip(weights, here, strict=True):
            whole[y : y + h, x : x + w] = g
        places.append((slice(y, y + h), slice(x, x + w), kept))
        expected.append(images)
        for name, value in gradients.items():
            to_expect[name] = to_expect.get(name, torch.zeros(())) + value
    actual, gradients = differentiate(kind_of(scene).render, scene, weights, torch.float32)
    errors = {
        name: max(
            relative_error(getattr(actual, name)[rows, columns][kept], getattr(there, name)[kept])
            for (rows, columns, kept), there in zip(places, expected, strict=True)
        )
        for name in Rendering._fields
    }
    # the background's gradient is of the whole picture, which has no weight elsewhere
    return Comparison(
        errors,
        _gradient_errors(gradients, to_expect),
        1 - sum(kept.float().mean().item() for *_, kept in places) / len(places),
        dict.fromkeys(NAMES, TOLERANCE),
        all(torch.isfinite(x).all() for x in (*actual, *gradients.values())),
    )
