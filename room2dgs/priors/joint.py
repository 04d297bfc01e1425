"""All depth priors bent together until they agree.

A network's depth is off by a smooth factor that changes over the image, not by one scale and shift. Each map is
multiplied by exp of a coarse grid, and the grids of all views are solved together, coarse to fine, for what must
hold: sparse points lie at their depth, views that see one surface see it at one place, and the slope of the depth
is the one that the normal prior says. Residuals are robust (Geman and McClure 1985), since points are hidden,
views occlude each other and priors fail.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.priors import warp_grid
from room2dgs.priors.overlap import Overlap, overlap
from room2dgs.scene.scene import Frame, PointCloud
from room2dgs.torch_threads import one_torch_thread


class Stage(NamedTuple):
    """One grid size.

    Attributes:
        rows, columns: knots of each view's grid.
        steps: of Adam.
        rate: its first rate, in logarithms of depth.
        view_width: relative difference between two views at which a residual starts to count as an outlier.
        plane_width: likewise for the bend of a plain piece of the photo.
    """

    rows: int
    columns: int
    steps: int
    rate: float
    view_width: float
    plane_width: float


STAGES = (
    Stage(3, 4, 150, 0.03, 0.15, 0.05),
    Stage(6, 8, 150, 0.03, 0.08, 0.05),
    Stage(12, 16, 300, 0.03, 0.05, 0.03),
    Stage(24, 32, 200, 0.01, 0.05, 0.02),
)
LAST_RATE = 0.02  # of the first one, reached exponentially
POINT_WIDTH = 0.03  # relative depth error of a sparse point
SLOPE_WIDTH = 0.3  # sine between the surface and the normal prior's plane
POINT_WEIGHT, VIEW_WEIGHT, SLOPE_WEIGHT, PLANE_WEIGHT = 3.0, 3.0, 1.0, 2.0
# A bend of 6 % from knot to knot, or a factor of 5 %, costs about what an outlier does.
BENDING_WEIGHT, SIZE_WEIGHT = 8.0, 2.4
# Samples of each kind in a step, for each view and in all.
SAMPLES_A_VIEW, SAMPLES = 64, (2000, 16000)
SLOPE_STEP = 4  # kept pixels between the two ends of a slope: shorter ones are rounding, longer ones another surface
PLANE_COSINE = 0.9  # between the normals at both ends of a piece that may be plane
SLOPE_JUMP = 0.15  # ends that differ more, relatively, lie on two surfaces


class Joint(NamedTuple):
    """What came out.

    Attributes:
        depths: frame name -> (H, W) float32 metres, 0 = invalid.
        between_views: median relative difference where two views see the same, before and after; NaN without pairs.
        at_points: median relative difference to the sparse points, before and after; NaN without points.
    """

    depths: dict[str, np.ndarray]
    between_views: tuple[float, float]
    at_points: tuple[float, float]


@one_torch_thread()
def joint_depths(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    points: PointCloud,
    progress: Callable[[str], None] = lambda line: None,
) -> Joint:
    """Bend the depth maps of some frames so that they agree; the same input gives the same bits.

    Args:
        frames: training views; those without a map in `depths` are passed over.
        depths: frame name -> (H, W) float32, metres, aligned view by view (`align`), 0 = invalid.
        normals: frame name -> (H, W, 3) float32, unit, world frame; may be empty.
        points: sparse points, metres.
        progress: takes one line for each stage.
    """
    frames = [frame for frame in frames if frame.name in depths]
    if not frames:
        return Joint({}, (float("nan"),) * 2, (float("nan"),) * 2)
    views = overlap(frames, depths, normals, points)
    start = torch.zeros(len(views), STAGES[0].rows, STAGES[0].columns)
    grid = start
    for stage in STAGES:
        grid = _solved(views, warp_grid.finer(grid, stage.rows, stage.columns), stage)
        progress(f"depth prior: {stage.rows} x {stage.columns} knots a view done")
    bent = {}
    for frame, knots in zip(frames, grid, strict=True):
        depth = depths[frame.name]
        bent[frame.name] = (depth * torch.exp(warp_grid.whole(knots, *depth.shape)).numpy()).astype(np.float32)
    before, after = _differences(views, start), _differences(views, grid)
    return Joint(bent, (before[0], after[0]), (before[1], after[1]))


def _solved(views: Overlap, start: Tensor, stage: Stage) -> Tensor:
    grid = start.clone().requires_grad_(True)
    adam = torch.optim.Adam([grid], lr=stage.rate)
    generator = torch.Generator().manual_seed(0)
    count = int(np.clip(SAMPLES_A_VIEW * len(views), *SAMPLES))
    for step in range(stage.steps):
        adam.param_groups[0]["lr"] = stage.rate * LAST_RATE ** (step / stage.steps)
        points = _robust(_point_residuals(views, grid, count, generator), POINT_WIDTH)
        between = _robust(_view_residuals(views, grid, count, generator), stage.view_width)
        slopes = _robust(_slope_residuals(views, grid, count, generator), SLOPE_WIDTH)
        bends = _robust(_plane_residuals(views, grid, count, generator), stage.plane_width)
        loss = POINT_WEIGHT * points + VIEW_WEIGHT * between + SLOPE_WEIGHT * slopes + PLANE_WEIGHT * bends
        loss = loss + BENDING_WEIGHT * warp_grid.bending(grid) + SIZE_WEIGHT * grid.square().mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
    return grid.detach()


def _robust(residual: Tensor, width: float) -> Tensor:
    """Mean of r^2 / (r^2 + width^2): at most 1 each; 0 without any. Scalar."""
    squared = (residual / width).square()
    return (squared / (1 + squared)).sum() / max(1, len(residual))


def _point_residuals(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Log of bent depth over point depth, at random sparse points."""
    if not len(views.point_view):
        return grid.new_zeros(0)
    some = torch.randint(len(views.point_view), (count,), generator=generator)
    view, pixel = views.point_view[some], views.point_px[some]
    bend = warp_grid.at(grid, view, pixel / views.size[view])
    return torch.log(views.point_prior[some] / views.point_depth[some]) + bend


def _view_residuals(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Log of one view's depth, carried to another view, over that one's own; at random pixels of random pairs."""
    if not len(views.pairs):
        return grid.new_zeros(0)
    view, other = views.pairs[torch.randint(len(views.pairs), (count,), generator=generator)].T
    row = torch.randint(views.depth.shape[1], (count,), generator=generator)
    column = torch.randint(views.depth.shape[2], (count,), generator=generator)
    pixel, depth = views.pixel(row, column), views.depth[view, row, column]
    bent = depth * torch.exp(warp_grid.at(grid, view, pixel / views.size[view]))
    there, z = views.seen_by(other, view, views.rays(view, pixel) * bent[:, None])
    inside = (depth > 0) & (z > 0.05) & (there > 0).all(dim=1) & (there < views.size[other]).all(dim=1)
    view, other, there, z = view[inside], other[inside], there[inside], z[inside]
    known, good = views.depth_at(other, there)
    bend = warp_grid.at(grid, other, there / views.size[other])
    return (torch.log(z) - torch.log(known.clamp(min=1e-6)) - bend)[good]


def _slope_residuals(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Sine of the angle between short pieces of the bent surface and the plane of the normal prior between them."""
    rows, columns = (size - SLOPE_STEP for size in views.depth.shape[1:])
    if min(rows, columns) < 1:
        return grid.new_zeros(0)
    view = torch.randint(len(views), (count,), generator=generator)
    row = torch.randint(rows, (count,), generator=generator)
    column = torch.randint(columns, (count,), generator=generator)
    down = torch.randint(2, (count,), generator=generator)
    end_row, end_column = row + SLOPE_STEP * down, column + SLOPE_STEP * (1 - down)
    normal = views.normal[view, (row + end_row) // 2, (column + end_column) // 2]
    first, last = views.depth[view, row, column], views.depth[view, end_row, end_column]
    near, far = torch.minimum(first, last), torch.maximum(first, last)
    good = (near > 0) & (far < (1 + SLOPE_JUMP) * near) & normal.any(dim=1)
    view, normal = view[good], normal[good]

    def point(r: Tensor, c: Tensor, depth: Tensor) -> Tensor:
        pixel = views.pixel(r[good], c[good])
        bent = depth[good] * torch.exp(warp_grid.at(grid, view, pixel / views.size[view]))
        return views.rays(view, pixel) * bent[:, None]

    piece = point(end_row, end_column, last) - point(row, column, first)
    return (piece * normal).sum(dim=1) / piece.norm(dim=1).clamp(min=1e-6)


def _plane_residuals(views: Overlap, grid: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """How far a plain piece of the photo is from a plane: on a plane 1 / depth is linear over the image.

    Three kept pixels in a row, the middle one's depth times the mean of 1 / depth at the ends, less 1.
    """
    height, width = views.depth.shape[1:]
    view = torch.randint(len(views), (count,), generator=generator)
    row = torch.randint(height, (count,), generator=generator)
    column = torch.randint(width, (count,), generator=generator)
    reach = max(2, width // 4)
    down = torch.randint(-reach, reach + 1, (count,), generator=generator)
    right = torch.randint(-reach, reach + 1, (count,), generator=generator)
    inside = ((row - down.abs()).clamp(min=-1) >= 0) & (row + down.abs() < height)
    inside &= (column - right.abs() >= 0) & (column + right.abs() < width) & (down.abs() + right.abs() >= 4)
    view, row, column, down, right = (part[inside] for part in (view, row, column, down, right))
    places = [(row + side * down, column + side * right) for side in (-1, 0, 1)]
    regions = [views.region[view, r, c] for r, c in places]
    normals = [views.region_normal[view, r, c] for r, c in places]
    depths = [views.depth[view, r, c] for r, c in places]
    good = (regions[0] > 0) & (regions[0] == regions[1]) & (regions[1] == regions[2])
    good &= torch.stack(depths).amin(dim=0) > 0
    good &= (normals[0] * normals[2]).sum(dim=1) >= PLANE_COSINE
    view = view[good]
    logs = []
    for (r, c), depth in zip(places, depths, strict=True):
        bend = warp_grid.at(grid, view, views.pixel(r[good], c[good]) / views.size[view])
        logs.append(torch.log(depth[good]) + bend)
    return 0.5 * (torch.exp(logs[1] - logs[0]) + torch.exp(logs[1] - logs[2])) - 1


def _differences(views: Overlap, grid: Tensor) -> tuple[float, float]:
    """Median absolute relative differences between views and at the points; NaN where there are none."""
    generator = torch.Generator().manual_seed(1)
    parts = [make(views, grid, SAMPLES[1], generator) for make in (_view_residuals, _point_residuals)]
    return tuple(float(part.abs().median()) if len(part) else float("nan") for part in parts)
