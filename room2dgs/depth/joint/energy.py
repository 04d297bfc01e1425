"""The energy that joint depth minimises: its weights, and its gradient by the compiled kernel."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.depth.joint.overlap import Overlap


class Weights(NamedTuple):
    """What the terms weigh.

    Attributes:
        terms: (5,) float32 weights of the robust means: points, views, slopes, planes, axes.
        widths: (5,) float32 residuals at which they start to count as outliers: relative depth, twice; sine; relative
            deviation from a plane; sine.
        smoothness, magnitude: of the grids' second differences and of the log-scale itself.
    """

    terms: Tensor
    widths: Tensor
    smoothness: float
    magnitude: float


class Energy:
    """The energy of the grids of some views; `reference.energy` is the same in plain torch.

    Args:
        axes: (1 or 3, 3) the room's, up first, world frame; None: no Manhattan prior.
        stiffness: (V, R, C) weight of the regularisers at each knot.
    """

    def __init__(self, views: Overlap, weights: Weights, stiffness: Tensor, axes: Tensor | None) -> None:
        self.weights = weights
        self.scene: dict[str, Any] = {
            "depth": views.depth,
            "depth_confidence": views.depth_confidence,
            "normal": views.normal,
            "normal_confidence": views.normal_confidence,
            "region": views.region,
            "region_normal": views.region_normal,
            "view_table": _view_table(views),
            "pair_views": views.pairs.T.int().contiguous(),
            "pair_table": _pair_table(views),
            "point_place": views.point_px / views.cameras.size[views.point_view],
            "point_off": torch.log(views.point_prior / views.point_depth),
            "axes": None if axes is None else torch.einsum("vij,aj->aiv", views.cameras.rotation, axes).contiguous(),
            "stiffness": stiffness.contiguous(),
            "weights": weights.terms,
            "widths": weights.widths,
            "step": views.step,
            "smoothness": weights.smoothness,
            "magnitude": weights.magnitude,
        }

    def gradient(self, grid: Tensor, draws: Tensor, gradient: Tensor) -> float:
        """Writes the gradient (V, R, C) at `grid` (V, R, C) float32, and gives the energy, at the samples `draws`.

        The same bits on any number of threads. A term without a residual counts as 0.

        Raises:
            ValueError: draws of views, samples, points or pairs that are not there.
        """
        given: dict[str, Any] = {"grid": grid, "draws": draws, "gradient": gradient}
        return _C.joint_gradient(**given, **self.scene)


def _view_table(views: Overlap) -> Tensor:
    """(6, V) float32: principal point, 1 / focal length, 1 / size, each in x and y."""
    cameras = views.cameras
    parts = (cameras.principal.double(), 1 / cameras.focal.double(), 1 / cameras.size.double())
    return torch.cat(parts, dim=1).T.float().contiguous()


def _pair_table(views: Overlap) -> Tensor:
    """(18, P) float32: from each pair's first camera frame to the second's (3 x 4), the second's focal length,
    principal point and size."""
    cameras = views.cameras
    view, other = views.pairs.T
    rotation, translation = cameras.rotation.double(), cameras.translation.double()
    turn = rotation[other] @ rotation[view].transpose(1, 2)
    shift = translation[other] - torch.einsum("pij,pj->pi", turn, translation[view])
    there = torch.cat([turn, shift[:, :, None]], dim=2).reshape(-1, 12)
    parts = (there.float(), cameras.focal[other], cameras.principal[other], cameras.size[other])
    return torch.cat(parts, dim=1).T.contiguous()
