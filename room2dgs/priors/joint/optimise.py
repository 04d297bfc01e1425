"""All depth priors bent together until they agree.

A network's depth is off by a smooth factor that changes over the image, not by one scale and shift. Each map is
multiplied by exp of a coarse grid, and the grids of all views are solved together, coarse to fine, for what must
hold: sparse points lie at their depth, views that see one surface see it at one place, the slope of the depth is
the one that the normal prior says, plain pieces of a photo are planes, and in a room whose walls stand at right
angles those that nearly face an axis do. Residuals are robust (Geman and McClure 1985), since points are hidden,
views occlude each other and priors fail.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.scene import Frame, PointCloud
from room2dgs.priors.joint import log_scale_grid as warp_grid
from room2dgs.priors.joint.overlap import Overlap, overlap
from room2dgs.priors.joint.room_axes import room_axes
from room2dgs.priors.joint.terms import at_points, between_views, of_axes, of_planes, of_slopes, robust
from room2dgs.torch_threads import one_torch_thread


class Stage(NamedTuple):
    """One grid size.

    Attributes:
        rows, columns: knots of each view's grid.
        steps: of Adam.
        rate: its first rate, in logarithms of depth.
        view_width: relative difference between two views at which a residual starts to count as an outlier.
        plane_width: likewise for the bend of a plain piece of the photo.
        square: the room's axes are looked for, and used.
    """

    rows: int
    columns: int
    steps: int
    rate: float
    view_width: float
    plane_width: float
    square: bool = False


STAGES = (
    Stage(3, 4, 150, 0.03, 0.15, 0.05),
    Stage(6, 8, 150, 0.03, 0.08, 0.05),
    Stage(12, 16, 300, 0.03, 0.05, 0.03),
    Stage(12, 16, 200, 0.02, 0.05, 0.02, square=True),
    Stage(24, 32, 200, 0.01, 0.05, 0.02, square=True),
)
LAST_RATE = 0.02  # of the first one, reached exponentially
POINT_WIDTH = 0.03  # relative depth error of a sparse point
MISFIT = 0.05  # relative
SLOPE_WIDTH = 0.3  # sine between the surface and the normal prior's plane
AXIS_WIDTH = 0.1  # sine
POINT_WEIGHT, VIEW_WEIGHT, SLOPE_WEIGHT, PLANE_WEIGHT, AXIS_WEIGHT = 3.0, 15.0, 4.0, 1.0, 1.0
# Chosen with the maps of a network (docs/results.md): its normals and what its views share are better than its depth.
# Bending holds the step from knot to knot, size the factor itself.
BENDING_WEIGHT, SIZE_WEIGHT = 8.0, 0.3
LEAST_STIFF = 0.1  # of a map that nobody believes: something must hold it where nothing else does
# Samples of each kind in a step, for each view and in all.
SAMPLES_A_VIEW, SAMPLES = 64, (2000, 16000)


class Joint(NamedTuple):
    """What came out.

    Attributes:
        depths: frame name -> (H, W) float32 metres, 0 = invalid.
        between_views: median relative difference where two views see the same, before and after; NaN without pairs.
        at_points: median relative difference to the sparse points, before and after; NaN without points.
        misfit: share of the sparse points that are still off by more than `MISFIT`; NaN without points.
    """

    depths: dict[str, np.ndarray]
    between_views: tuple[float, float]
    at_points: tuple[float, float]
    misfit: float


@one_torch_thread()
def joint_depths(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    points: PointCloud,
    square: bool = True,
    depth_weights: Mapping[str, np.ndarray] | None = None,
    normal_weights: Mapping[str, np.ndarray] | None = None,
) -> Joint:
    """Bend the depth maps of some frames so that they agree; the same input gives the same bits.

    Args:
        frames: training views; those without a map in `depths` are passed over.
        depths: frame name -> (H, W) float32, metres, aligned view by view (`align`), 0 = invalid.
        normals: frame name -> (H, W, 3) float32, unit, world frame; may be empty.
        points: sparse points, metres.
        square: plain walls and floors that nearly face one of the room's axes are taken to face it.
        depth_weights, normal_weights: frame name -> (H, W) in 0..1, how far each pixel is believed; 1 for the others.
            Where a depth is not, its map bends easily and says little to other views.
    """
    frames = [frame for frame in frames if frame.name in depths]
    if not frames:
        return Joint({}, (float("nan"),) * 2, (float("nan"),) * 2, float("nan"))
    views = overlap(frames, depths, normals, points, depth_weights, normal_weights)
    start = torch.zeros(len(views), STAGES[0].rows, STAGES[0].columns, dtype=torch.float32)
    grid = start
    for stage in STAGES:
        grid = warp_grid.finer(grid, stage.rows, stage.columns)
        grid = _solved(views, grid, stage, room_axes(views, grid) if square and stage.square else None)
    bent = {}
    for frame, knots in zip(frames, grid, strict=True):
        depth = depths[frame.name]
        bent[frame.name] = (depth * torch.exp(warp_grid.whole(knots, *depth.shape)).numpy()).astype(np.float32)
    before, after = _differences(views, start), _differences(views, grid)
    return Joint(bent, (before[0], after[0]), (before[1], after[1]), after[2])


def _solved(views: Overlap, start: Tensor, stage: Stage, axes: Tensor | None) -> Tensor:
    grid = start.clone().requires_grad_(True)
    adam = torch.optim.Adam([grid], lr=stage.rate)
    stiffness = _stiffness(views, stage)
    generator = torch.Generator().manual_seed(0)
    count = int(np.clip(SAMPLES_A_VIEW * len(views), *SAMPLES))
    for step in range(stage.steps):
        adam.param_groups[0]["lr"] = stage.rate * LAST_RATE ** (step / stage.steps)
        drawn = (views, grid, count, generator)
        loss = POINT_WEIGHT * robust(at_points(*drawn), POINT_WIDTH)
        between, trust = between_views(*drawn)
        loss = loss + VIEW_WEIGHT * robust(between, stage.view_width, trust)
        slopes, trust = of_slopes(*drawn)
        loss = loss + SLOPE_WEIGHT * robust(slopes, SLOPE_WIDTH, trust)
        loss = loss + PLANE_WEIGHT * robust(of_planes(*drawn), stage.plane_width)
        if axes is not None:
            loss = loss + AXIS_WEIGHT * robust(of_axes(views, grid, axes, count, generator), AXIS_WIDTH)
        loss = loss + BENDING_WEIGHT * warp_grid.bending(grid, stiffness)
        loss = loss + SIZE_WEIGHT * (stiffness * grid.square()).mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
    return grid.detach()


def _stiffness(views: Overlap, stage: Stage) -> Tensor:
    """(V, rows, columns) how much each knot resists: the mean trust in the depth about it."""
    size = (stage.rows, stage.columns)
    mean = torch.nn.functional.interpolate(views.depth_weight[:, None], size=size, mode="area")[:, 0]
    return mean.clamp(min=LEAST_STIFF)


def _differences(views: Overlap, grid: Tensor) -> tuple[float, float, float]:
    """Median absolute relative differences between views and at the points, and the share of points that are off by
    more than `MISFIT`; NaN where there are none."""
    generator = torch.Generator().manual_seed(1)
    between = between_views(views, grid, SAMPLES[1], generator)[0].abs()
    points = at_points(views, grid, SAMPLES[1], generator).abs()
    medians = [float(part.median()) if len(part) else float("nan") for part in (between, points)]
    return *medians, float((points > MISFIT).float().mean()) if len(points) else float("nan")
