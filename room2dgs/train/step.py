"""One iteration: render a view, compare it with its photo, step."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs import splat
from room2dgs.config import Config, RenderConfig
from room2dgs.splat.types import Rendering, Surfels
from room2dgs.train.clock import StageClock
from room2dgs.train.diverged import check_gradients, check_loss
from room2dgs.train.model import Model
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.objective import Term, loss_terms, multiview_loss_terms, needed_maps, total_loss
from room2dgs.train.optimiser import set_rates
from room2dgs.train.schedule import active_sh_degree, learning_rates
from room2dgs.train.statistics import psnr_db
from room2dgs.train.views import View, Views


class Step(NamedTuple):
    """What one iteration saw.

    Attributes:
        losses: unweighted value of each active term, and "loss", their weighted sum.
        color: (H, W, 3) the rendering.
        target: (H, W, 3) the photo.
        depth, alpha: (H, W) of the rendering.
        opacities: (N,) of the surfels rendered, center_gradients: (N, 2) of their projected centres, 1/pixel;
            None unless asked for.
    """

    losses: dict[str, float]
    color: Tensor
    target: Tensor
    depth: Tensor
    alpha: Tensor
    opacities: Tensor | None = None
    center_gradients: Tensor | None = None


def iterate(
    model: Model,
    view: View,
    config: Config,
    extent_m: float,
    clock: StageClock,
    watched: bool = False,
    pair: Pair | None = None,
) -> Step:
    """Take one step on one view; `model.iteration` goes up by one.

    Args:
        extent_m: `Scene.extent`, the scale of the centres' learning rate.
        watched: note the surfels' opacities and the gradients of their projected centres.
        pair: the view with a neighbour, for the multi-view terms.

    Raises:
        RuntimeError: a loss or gradient that is not finite; the model is as it was before.
    """
    iteration = model.iteration
    target = view.target()
    clock.lap("data")

    center_px = torch.zeros(model.surfel_count, 2, dtype=torch.float32, requires_grad=True) if watched else None

    def rendered() -> tuple[Surfels, Rendering]:
        surfels = model.surfels(active_sh_degree(iteration, config.render))
        maps = needed_maps(view, config, iteration, pair)
        return surfels, render_view(surfels, view, config.render, center_px=center_px, **maps)

    def terms_of(rendering: Rendering) -> dict[str, Term]:
        terms = loss_terms(rendering, target, view, config, iteration)
        clock.lap("loss")
        terms |= multiview_loss_terms(rendering, view, pair, config, iteration) if pair else {}
        clock.lap("multiview")
        return terms

    surfels, rendering = rendered()
    clock.lap("render")
    terms = terms_of(rendering)
    loss = total_loss(terms)
    losses = {name: term.value.item() for name, term in terms.items()} | {"loss": loss.item()}
    check_loss(losses, iteration)
    clock.lap("loss")
    model.adam.zero_grad(set_to_none=True)
    loss.backward()
    clock.lap("backward")
    check_gradients(model.decoder.parameters(), iteration, lambda: terms_of(rendered()[1]))
    set_rates(model.adam, learning_rates(iteration, config.train.iterations, config.train.rates, extent_m))
    model.adam.step()
    model.decoder.constrain()
    model.iteration += 1
    clock.lap("optimiser")
    seen = (surfels.opacities.detach(), center_px.grad) if watched else ()
    color, depth, alpha = (values.detach() for values in (rendering.color, rendering.depth, rendering.alpha))
    return Step(losses, color, target, depth, alpha, *seen)


def render_view(
    surfels: Surfels,
    view: View,
    render: RenderConfig,
    *,
    center_px: Tensor | None = None,
    with_normal: bool = False,
    with_distortion: bool = False,
) -> Rendering:
    """Render one view over the configured background; maps that are not asked for are zeros."""
    return splat.render(
        surfels,
        view.K,
        view.cam_from_world,
        view.width,
        view.height,
        background=torch.tensor(render.background, dtype=torch.float32),
        near_m=render.near_m,
        center_px=center_px,
        with_normal=with_normal,
        with_distortion=with_distortion,
    )


def current_surfels(model: Model, render: RenderConfig) -> Surfels:
    """The model's surfels as its last iteration saw them, without gradients."""
    with torch.no_grad():
        return model.surfels(active_sh_degree(max(0, model.iteration - 1), render))


def mean_psnr_db(model: Model, views: Views, render: RenderConfig) -> float:
    """Mean PSNR of the model's renderings over all of `views` at full size, decibels."""
    surfels = current_surfels(model, render)
    with torch.no_grad():
        seen = (views.at(index) for index in range(len(views)))
        values = [psnr_db(render_view(surfels, view, render).color, view.target()) for view in seen]
    return sum(values) / len(values)
