"""The joint depth optimisation's energy in plain torch: any dtype, differentiable by autograd; in float64 the oracle
of the compiled kernel."""

from __future__ import annotations

from dataclasses import fields, replace

import torch
from torch import Tensor

from room2dgs.depth.joint import draws as rows_of
from room2dgs.depth.joint import log_scale_grid
from room2dgs.depth.joint.energy import Weights
from room2dgs.depth.joint.overlap import Overlap
from room2dgs.depth.joint.residuals import at_points, optimised_points, view_residuals
from room2dgs.geometry.camera_tensors import CameraTensors

# The kernel's own limits, see depth/csrc.
SLOPE_JUMP = 0.15  # ends that differ more, relatively, lie on two surfaces
PLANE_COSINE = 0.9  # between the smoothed normals of points of one textureless region that may be one plane
AXIS_COSINE = 0.97  # 14 degrees: a surface that faces an axis so nearly is taken to face it
UPRIGHT_SINE = 0.25  # and one that leans less for a wall
MIN_STEP = 4  # samples between two points of a textureless region


def in_float64(views: Overlap) -> Overlap:
    """The same views, their numbers in double precision."""

    def wide(value):
        if isinstance(value, CameraTensors):
            return CameraTensors(*map(wide, value))
        return value.double() if isinstance(value, Tensor) and value.is_floating_point() else value

    return replace(views, **{field.name: wide(getattr(views, field.name)) for field in fields(views)})


def energy(
    views: Overlap, grid: Tensor, draws: Tensor, weights: Weights, stiffness: Tensor, axes: Tensor | None
) -> Tensor:
    """The weighted sum of the robust means of all residuals at the samples `draws`, of the grids' bending energy and of
    their magnitude. Scalar; see `energy.Energy`."""
    drawn = draws.long()
    ones = None
    residuals = [
        (point_residuals(views, grid, drawn[rows_of.POINTS]), ones),
        view_residuals(views, grid, drawn[rows_of.VIEWS]),
        normal_residuals(views, grid, drawn[rows_of.SLOPES]),
        (planarity_residuals(views, grid, drawn[rows_of.PLANES]), ones),
    ]
    if axes is not None:
        residuals.append((axis_residuals(views, grid, axes, drawn[rows_of.AXES]), ones))
    total = weights.smoothness * log_scale_grid.smoothness(grid, stiffness)
    total = total + weights.magnitude * (stiffness * grid.square()).mean()
    for (residual, confidence), weight, width in zip(residuals, weights.terms, weights.widths, strict=False):
        total = total + float(weight) * robust(residual, float(width), confidence)
    return total


def robust(residual: Tensor, width: float, weight: Tensor | None = None) -> Tensor:
    """Mean of weight r^2 / (r^2 + width^2) (Geman and McClure 1985): at most 1 each; 0 without any. Scalar."""
    squared = (residual / width).square()
    cost = squared / (1 + squared)
    return (cost if weight is None else weight * cost).sum() / max(1, len(residual))


def point_residuals(views: Overlap, grid: Tensor, draws: Tensor) -> Tensor:
    """(N,) log of optimised depth over point depth, at the points `draws` (2, N) int64: view, point; none without."""
    return at_points(views, grid, draws[1]) if len(views.point_view) else grid.new_zeros(0)


def normal_residuals(views: Overlap, grid: Tensor, draws: Tensor) -> tuple[Tensor, Tensor]:
    """Sine of the angle between short segments of the optimised surface and the plane of the normal prior there.

    Args:
        draws: (4, K) int64, views, rows, columns, and 1 = down or 0 = right.

    Returns:
        (N,) the sines, and (N,) the confidence in the normals, where there is a surface with a normal.
    """
    if min(views.depth.shape[1:]) <= rows_of.SLOPE_STEP:
        return grid.new_zeros(0), grid.new_zeros(0)
    view, row, column, down = draws
    end_row, end_column = row + rows_of.SLOPE_STEP * down, column + rows_of.SLOPE_STEP * (1 - down)
    middle = (view, (row + end_row) // 2, (column + end_column) // 2)
    normal, weight = views.normal[middle], views.normal_confidence[middle]
    first, last = views.depth[view, row, column], views.depth[view, end_row, end_column]
    near, far = torch.minimum(first, last), torch.maximum(first, last)
    good = (near > 0) & (far < (1 + SLOPE_JUMP) * near) & normal.any(dim=1)
    view, normal = view[good], normal[good]
    start = optimised_points(views, grid, view, row[good], column[good])
    segment = optimised_points(views, grid, view, end_row[good], end_column[good]) - start
    return (segment * normal).sum(dim=1) / segment.norm(dim=1).clamp(min=1e-6), weight[good]


def planarity_residuals(views: Overlap, grid: Tensor, draws: Tensor) -> Tensor:
    """(N,) deviation of textureless regions from a plane: on a plane 1 / depth is linear over the image.

    Three samples in a row: the depth of the middle one times the mean of 1 / depth at the ends, less 1.

    Args:
        draws: (5, K) int64, views, rows and columns of the middle, steps down and right.
    """
    view, row, column, down, right = _inside(views, draws)
    view, rows, columns = _in_one_region(
        views, view, (row - down, row, row + down), (column - right, column, column + right)
    )
    first, middle, last = (optimised_points(views, grid, view, r, c)[:, 2] for r, c in zip(rows, columns, strict=True))
    return 0.5 * (middle / first + middle / last) - 1


def axis_residuals(views: Overlap, grid: Tensor, axes: Tensor, draws: Tensor) -> Tensor:
    """Manhattan prior: sine of the angle of textureless regions to the axis that they nearly face; tilt of other walls.

    Args:
        axes: (1 or 3, 3) as `room_axes` has them: up first.
        draws: (5, K) int64, views, rows and columns of the first of three points, steps down and right to the second.
    """
    view, row, column, down, right = _inside(views, draws)
    # two points at a right angle from the first
    view, rows, columns = _in_one_region(
        views, view, (row, row + down, row - right), (column, column + right, column + down)
    )
    first, second, third = (optimised_points(views, grid, view, r, c) for r, c in zip(rows, columns, strict=True))
    normal = torch.linalg.cross(second - first, third - first)
    normal = normal / normal.norm(dim=1, keepdim=True).clamp(min=1e-9)
    along = torch.einsum("nij,aj,ni->na", views.cameras.rotation[view], axes, normal)
    nearest, _ = along.abs().max(dim=1)
    facing = nearest.detach() > AXIS_COSINE
    leaning = ~facing & (along[:, 0].detach().abs() < UPRIGHT_SINE)
    return torch.cat([(1 - nearest[facing].square()).clamp(min=1e-12).sqrt(), along[leaning, 0]])


def _inside(views: Overlap, draws: Tensor) -> tuple[Tensor, ...]:
    """Those of the draws whose steps stay inside to every side."""
    height, width = views.depth.shape[1:]
    _, row, column, down, right = draws
    longest = torch.maximum(down.abs(), right.abs())
    inside = (longest >= MIN_STEP) & (row >= longest) & (row + longest < height)
    inside &= (column >= longest) & (column + longest < width)
    return tuple(draws[:, inside])


def _in_one_region(
    views: Overlap, view: Tensor, rows: tuple[Tensor, ...], columns: tuple[Tensor, ...]
) -> tuple[Tensor, list[Tensor], list[Tensor]]:
    """Those of the points that lie in one textureless region with one normal, and have a depth."""
    region = torch.stack([views.region[view, r, c] for r, c in zip(rows, columns, strict=True)])
    depth = torch.stack([views.depth[view, r, c] for r, c in zip(rows, columns, strict=True)])
    normal = torch.stack([views.region_normal[view, r, c] for r, c in zip(rows, columns, strict=True)])
    good = (region[0] > 0) & (region == region[0]).all(dim=0) & (depth > 0).all(dim=0)
    for first, second in ((0, 1), (0, 2), (1, 2)):
        good &= (normal[first] * normal[second]).sum(dim=1) >= PLANE_COSINE
    return view[good], [r[good] for r in rows], [c[good] for c in columns]
