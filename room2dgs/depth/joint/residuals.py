"""What the optimised depth maps differ by: at sparse points and samples, and between two views."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.depth.joint import log_scale_grid
from room2dgs.depth.joint.overlap import Overlap
from room2dgs.geometry.camera import NEAR_M


def at_points(views: Overlap, grid: Tensor, some: Tensor) -> Tensor:
    """(N,) log of optimised depth over point depth, at the points `some` (N,) int64."""
    view, pixel = views.point_view[some], views.point_px[some]
    log_scale = log_scale_grid.at(grid, view, pixel / views.cameras.size[view])
    return torch.log(views.point_prior[some] / views.point_depth[some]) + log_scale


def view_residuals(views: Overlap, grid: Tensor, draws: Tensor) -> tuple[Tensor, Tensor]:
    """Log of one view's depth, warped into another view, over that view's own.

    Args:
        draws: (3, K) int64, pairs, rows and columns of their first views.

    Returns:
        (N,) the logarithms, and (N,) the lower confidence of the two depths, where both views have the surface.
    """
    if not len(views.pairs):
        return grid.new_zeros(0), grid.new_zeros(0)
    (view, other), row, column = views.pairs[draws[0]].T, *draws[1:]
    there, z = views.cameras.seen_by(other, view, optimised_points(views, grid, view, row, column))
    inside = (views.depth[view, row, column] > 0) & (z > NEAR_M) & views.cameras.inside(other, there)
    confidence = views.depth_confidence[view[inside], row[inside], column[inside]]
    other, there, z = other[inside], there[inside], z[inside]
    known, good = views.depth_at(other, there)
    log_scale = log_scale_grid.at(grid, other, there / views.cameras.size[other])
    # One weight for both sides: weighting each side by the other's alone is no gradient of an energy; scale drifts.
    weight = torch.minimum(confidence, views.confidence_at(other, there))
    return (torch.log(z) - torch.log(known.clamp(min=1e-6)) - log_scale)[good], weight[good]


def optimised_points(views: Overlap, grid: Tensor, view: Tensor, row: Tensor, column: Tensor) -> Tensor:
    """(N, 3) samples unprojected by the optimised depth, camera frame, metres; 0 where there is no depth."""
    pixel = views.pixel(row, column)
    depth = views.depth[view, row, column] * torch.exp(log_scale_grid.at(grid, view, pixel / views.cameras.size[view]))
    return views.cameras.rays(view, pixel) * depth[:, None]
