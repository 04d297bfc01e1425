"""The parts of one iteration: render a view, compare it with its photo, descend."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.config import Config, RenderConfig
from room2dgs.kernels.builds import is_asynchronous
from room2dgs.primitives.primitive import Splats
from room2dgs.primitives.registry import render
from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.splat.types import Rendering
from room2dgs.train.model import Model, set_rates
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.objective import Term, loss_terms, needed_maps, total_loss
from room2dgs.train.progress import StageClock
from room2dgs.train.schedule import active_sh_degree, opacity_floor, rates_at
from room2dgs.train.views import View, Views

BACKGROUND = 0x6267  # tells these draws from others of the same seed
BACKGROUNDS = 1009  # colours, after which they come again


class Step(NamedTuple):
    """What rendering a view and comparing it gave.

    Attributes:
        losses: unweighted value of each active term, and "loss", their weighted sum; where a GPU trains scalars
            on it, which it waits for when they are read.
        color: (H, W, 3) the rendering, as the photo was exposed.
        target: (H, W, 3) the photo; where a mask hides it, the rendering.
        depth, alpha: (H, W) of the rendering.
        terms_again: renders and computes the loss terms anew, differentiable, as long as the model is unchanged.
        opacities: (N,) of the surfels rendered, center_gradients: (N, 2) of their projected centres, 1/pixel;
            None unless asked for.
    """

    losses: dict[str, float | Tensor]
    color: Tensor
    target: Tensor
    depth: Tensor
    alpha: Tensor
    terms_again: Callable[[], dict[str, Term]]
    opacities: Tensor | None = None
    center_gradients: Tensor | None = None


def forward_backward(
    model: Model,
    view: View,
    config: Config,
    clock: StageClock,
    *,
    screen_gradients: bool = False,
    pair: Pair | None = None,
) -> Step:
    """Render a view, compare it, and leave the gradients of the loss with the model's parameters.

    Args:
        screen_gradients: note the surfels' opacities and the gradients of their projected centres.
        pair: the view with a neighbour, for the multi-view terms.
    """
    iteration = model.iteration
    target = view.target()
    clock.lap("data")
    center_px = None
    if screen_gradients:
        size = (model.count, 2)
        center_px = torch.zeros(size, dtype=torch.float32, device=view.K.device, requires_grad=True)

    def rendered() -> tuple[Splats, Rendering]:
        splats = model.splats(active_sh_degree(iteration, config.render))
        maps = needed_maps(view, config, iteration, pair)
        behind = background(iteration, config, view.K.device)
        floor = opacity_floor(iteration, config.train)
        return splats, render_view(
            splats, view, config.render, background=behind, opacity_floor=floor, center_px=center_px, **maps
        )

    # a pose that wants a gradient gets that of the rendering; the terms themselves take it as it is
    compared = view._replace(cam_from_world=view.cam_from_world.detach())

    def terms_of(rendering: Rendering) -> dict[str, Term]:
        return loss_terms(rendering, target, compared, config, iteration, pair, clock)

    splats, rendering = rendered()
    clock.lap("render")
    terms = terms_of(rendering)
    loss = total_loss(terms)
    losses = {name: _number(term.value) for name, term in terms.items()} | {"loss": _number(loss)}
    clock.lap("loss")
    model.adam.zero_grad(set_to_none=True)
    loss.backward()
    clock.lap("backward")
    seen = () if center_px is None else (splats.opacities.detach(), center_px.grad)
    color, depth, alpha = (values.detach() for values in (rendering.color, rendering.depth, rendering.alpha))
    color = view.exposed(color)
    return Step(losses, color, shown(target, view, color), depth, alpha, lambda: terms_of(rendered()[1]), *seen)


def descend(model: Model, config: Config, extent_m: float) -> None:
    """One step of the optimiser with the gradients that are there; `model.iteration` goes up by one.

    Args:
        extent_m: `Scene.extent`, the scale of the centres' learning rate.
    """
    rates = rates_at(model.iteration, config.train.iterations, config.train.rates, extent_m)
    set_rates(model.adam, model.decoder.learning_rates(rates))
    model.adam.step()
    model.decoder.constrain()
    model.iteration += 1


def render_view(
    splats: Splats,
    view: View,
    settings: RenderConfig,
    *,
    background: Tensor | None = None,
    opacity_floor: float = OPACITY_FLOOR,
    center_px: Tensor | None = None,
    with_normal: bool = False,
    with_distortion: bool = False,
) -> Rendering:
    """Render one view, over `settings.background` unless another is given; maps that are not asked for are zeros."""
    return render(
        splats,
        view.K,
        view.cam_from_world,
        view.width,
        view.height,
        background=_background(tuple(settings.background), view.K.device) if background is None else background,
        near_m=settings.near_m,
        opacity_floor=opacity_floor,
        center_px=center_px,
        with_normal=with_normal,
        with_distortion=with_distortion,
    )


def background(iteration: int, config: Config, device: torch.device) -> Tensor:
    """(3,) what a training view is rendered over: with train.random_background a colour of the iteration's own, so that
    no surface can pass for a dark one by being transparent."""
    if not config.train.random_background:
        return _background(tuple(config.render.background), device)
    return _backgrounds(config.train.seed % 2**63, device)[iteration % BACKGROUNDS]


@lru_cache(maxsize=4)
def _backgrounds(seed: int, device: torch.device) -> Tensor:
    """(BACKGROUNDS, 3), all at once: a GPU would wait for each."""
    random = np.random.default_rng([seed, BACKGROUND])
    return torch.from_numpy(random.random((BACKGROUNDS, 3), np.float32)).to(device)


@lru_cache(maxsize=4)
def _background(color: tuple[float, ...], device: torch.device) -> Tensor:
    return torch.tensor(color, dtype=torch.float32, device=device)


def _number(value: Tensor) -> float | Tensor:
    return value.detach() if is_asynchronous(value) else value.item()


def current_splats(model: Model, settings: RenderConfig) -> Splats:
    """The model's primitives as its last iteration saw them, without gradients."""
    with torch.no_grad():
        return model.splats(active_sh_degree(max(0, model.iteration - 1), settings))


def psnr_db(image: Tensor, target: Tensor) -> float | Tensor:
    """Peak signal-to-noise ratio of an image clamped to 0..1, decibels; on a GPU a scalar there."""
    with torch.no_grad():
        error = _number(torch.nn.functional.mse_loss(image.detach().clamp(0.0, 1.0), target))
    if isinstance(error, Tensor):
        return -10.0 * error.clamp(min=1e-12).log10()
    return -10.0 * math.log10(max(error, 1e-12)) if math.isfinite(error) else math.nan


def shown(target: Tensor, view: View, color: Tensor) -> Tensor:
    """(H, W, 3) in 0..1: the photo `target`; where the view's mask hides it, the rendering, so that both agree."""
    return target if view.mask is None else torch.where(view.mask[..., None], target, color)


def _psnr_of(splats: Splats, view: View, settings: RenderConfig) -> float | Tensor:
    color = view.exposed(render_view(splats, view, settings).color)
    return psnr_db(color, shown(view.target(), view, color))


def mean_psnr_db(model: Model, views: Views, settings: RenderConfig) -> float:
    """Mean PSNR of the model's renderings over all of `views` at full size, decibels."""
    splats = current_splats(model, settings)
    with torch.no_grad():
        seen = (views.at(index, priors=False) for index in range(len(views)))
        values = [_psnr_of(splats, view, settings) for view in seen]
    return float(sum(values)) / len(values)
