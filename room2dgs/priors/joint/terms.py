"""What bent depth maps ought to agree with, as residuals at random samples: points, other views, normals, planes.

Each function draws its samples, so that the same generator gives the same ones, and is differentiable with respect to
the grids.
"""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.priors.joint import log_scale_grid as warp_grid
from room2dgs.priors.joint.overlap import Overlap

SLOPE_STEP = 4  # kept pixels between the two ends of a slope: shorter ones are rounding, longer ones another surface
SLOPE_JUMP = 0.15  # ends that differ more, relatively, lie on two surfaces
PLANE_COSINE = 0.9  # between the normals of a plain piece at places that may be one plane
AXIS_COSINE = 0.97  # 14 degrees: a plain piece that faces an axis so nearly is taken to face it
UPRIGHT_SINE = 0.25  # and one that leans less for a wall
SHORTEST = 4  # kept pixels between two places of a plain piece


def robust(residual: Tensor, width: float, weight: Tensor | None = None) -> Tensor:
    """Mean of weight r^2 / (r^2 + width^2): at most 1 each; 0 without any. Scalar."""
    squared = (residual / width).square()
    cost = squared / (1 + squared)
    return (cost if weight is None else weight * cost).sum() / max(1, len(residual))


def at_points(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Log of bent depth over point depth, at random sparse points."""
    if not len(views.point_view):
        return grid.new_zeros(0)
    some = torch.randint(len(views.point_view), (count,), generator=generator)
    view, pixel = views.point_view[some], views.point_px[some]
    bend = warp_grid.at(grid, view, pixel / views.size[view])
    return torch.log(views.point_prior[some] / views.point_depth[some]) + bend


def between_views(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Log of one view's depth, carried to another view, over that one's own; at random pixels of random pairs.

    Returns:
        (N,) the logarithms, and (N,) the trust in the less certain one of the two.
    """
    if not len(views.pairs):
        return grid.new_zeros(0), grid.new_zeros(0)
    view, other = views.pairs[torch.randint(len(views.pairs), (count,), generator=generator)].T
    row = torch.randint(views.depth.shape[1], (count,), generator=generator)
    column = torch.randint(views.depth.shape[2], (count,), generator=generator)
    there, z = views.seen_by(other, view, bent_points(views, grid, view, row, column))
    inside = (
        (views.depth[view, row, column] > 0)
        & (z > 0.05)
        & (there > 0).all(dim=1)
        & (there < views.size[other]).all(dim=1)
    )
    trust = views.depth_weight[view[inside], row[inside], column[inside]]
    other, there, z = other[inside], there[inside], z[inside]
    known, good = views.depth_at(other, there)
    bend = warp_grid.at(grid, other, there / views.size[other])
    # one weight for both: were each side pulled by the other's trust alone, no energy would fall, and the scale drifts
    weight = torch.minimum(trust, views.weight_at(other, there))
    return (torch.log(z) - torch.log(known.clamp(min=1e-6)) - bend)[good], weight[good]


def of_slopes(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Sine of the angle between short pieces of the bent surface and the plane of the normal prior between them.

    Returns:
        (N,) the sines, and (N,) the trust in the normals.
    """
    rows, columns = (size - SLOPE_STEP for size in views.depth.shape[1:])
    if min(rows, columns) < 1:
        return grid.new_zeros(0), grid.new_zeros(0)
    view = torch.randint(len(views), (count,), generator=generator)
    row = torch.randint(rows, (count,), generator=generator)
    column = torch.randint(columns, (count,), generator=generator)
    down = torch.randint(2, (count,), generator=generator)
    end_row, end_column = row + SLOPE_STEP * down, column + SLOPE_STEP * (1 - down)
    middle = (view, (row + end_row) // 2, (column + end_column) // 2)
    normal, weight = views.normal[middle], views.normal_weight[middle]
    first, last = views.depth[view, row, column], views.depth[view, end_row, end_column]
    near, far = torch.minimum(first, last), torch.maximum(first, last)
    good = (near > 0) & (far < (1 + SLOPE_JUMP) * near) & normal.any(dim=1)
    view, normal = view[good], normal[good]
    start = bent_points(views, grid, view, row[good], column[good])
    piece = bent_points(views, grid, view, end_row[good], end_column[good]) - start
    return (piece * normal).sum(dim=1) / piece.norm(dim=1).clamp(min=1e-6), weight[good]


def of_planes(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """How far a plain piece of the photo is from a plane: on a plane 1 / depth is linear over the image.

    Three kept pixels in a row, the middle one's depth times the mean of 1 / depth at the ends, less 1.
    """
    view, row, column, down, right = _places(views, count, generator)
    view, rows, columns = _on_one_piece(
        views, view, (row - down, row, row + down), (column - right, column, column + right)
    )
    first, middle, last = (bent_points(views, grid, view, r, c)[:, 2] for r, c in zip(rows, columns, strict=True))
    return 0.5 * (middle / first + middle / last) - 1


def of_axes(views: Overlap, grid: Tensor, axes: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Sine of the angle between plain pieces and the room's axes, if they nearly face one; of the lean of other walls.

    Args:
        axes: (1 or 3, 3) as `room_axes` has them: up first.
    """
    view, row, column, down, right = _places(views, count, generator)
    # two places at a right angle from the first
    view, rows, columns = _on_one_piece(
        views, view, (row, row + down, row - right), (column, column + right, column + down)
    )
    first, second, third = (bent_points(views, grid, view, r, c) for r, c in zip(rows, columns, strict=True))
    normal = torch.linalg.cross(second - first, third - first)
    normal = normal / normal.norm(dim=1, keepdim=True).clamp(min=1e-9)
    along = torch.einsum("nij,aj,ni->na", views.rotation[view], axes, normal)
    nearest, _ = along.abs().max(dim=1)
    facing = nearest.detach() > AXIS_COSINE
    leaning = ~facing & (along[:, 0].detach().abs() < UPRIGHT_SINE)
    return torch.cat([(1 - nearest[facing].square()).clamp(min=1e-12).sqrt(), along[leaning, 0]])


def bent_points(views: Overlap, grid: Tensor, view: Tensor, row: Tensor, column: Tensor) -> Tensor:
    """(N, 3) what kept pixels see under the bent depth, camera frame, metres; 0 where there is no depth."""
    pixel = views.pixel(row, column)
    bent = views.depth[view, row, column] * torch.exp(warp_grid.at(grid, view, pixel / views.size[view]))
    return views.rays(view, pixel) * bent[:, None]


def _places(views: Overlap, count: int, generator: torch.Generator) -> tuple[Tensor, ...]:
    """Random views, kept rows and columns, and steps down and right that stay inside to every side."""
    height, width = views.depth.shape[1:]
    view = torch.randint(len(views), (count,), generator=generator)
    row = torch.randint(height, (count,), generator=generator)
    column = torch.randint(width, (count,), generator=generator)
    reach = max(2, width // 4)
    down = torch.randint(-reach, reach + 1, (count,), generator=generator)
    right = torch.randint(-reach, reach + 1, (count,), generator=generator)
    longest = torch.maximum(down.abs(), right.abs())
    inside = (longest >= SHORTEST) & (row >= longest) & (row + longest < height)
    inside &= (column >= longest) & (column + longest < width)
    return tuple(part[inside] for part in (view, row, column, down, right))


def _on_one_piece(
    views: Overlap, view: Tensor, rows: tuple[Tensor, ...], columns: tuple[Tensor, ...]
) -> tuple[Tensor, list[Tensor], list[Tensor]]:
    """Those of the places that lie on one plain piece with one normal, and have a depth."""
    region = torch.stack([views.region[view, r, c] for r, c in zip(rows, columns, strict=True)])
    depth = torch.stack([views.depth[view, r, c] for r, c in zip(rows, columns, strict=True)])
    normal = torch.stack([views.region_normal[view, r, c] for r, c in zip(rows, columns, strict=True)])
    good = (region[0] > 0) & (region == region[0]).all(dim=0) & (depth > 0).all(dim=0)
    for first, second in ((0, 1), (0, 2), (1, 2)):
        good &= (normal[first] * normal[second]).sum(dim=1) >= PLANE_COSINE
    return view[good], [r[good] for r in rows], [c[good] for c in columns]
