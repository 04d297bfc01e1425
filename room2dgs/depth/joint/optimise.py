"""Joint depth optimisation: one smooth log-scale grid for each depth prior, all solved together.

The error of a network's depth is a smooth factor that changes over the image, not one scale and shift. Each map is
multiplied by exp of a coarse grid. The grids of all views are optimised together, coarse to fine. The energy has five
data terms: depth at the sparse points, consistency between views, slopes against the normal prior, planarity of
textureless regions, and the Manhattan prior (walls that nearly face an axis of the room face it). Residuals are robust
(Geman and McClure 1985), because points are hidden, views occlude each other and priors fail. Each step of Adam takes
the gradient at samples drawn at random; the compiled kernel computes it (`energy.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.depth.joint import log_scale_grid
from room2dgs.depth.joint.draws import drawn
from room2dgs.depth.joint.energy import Energy, Weights
from room2dgs.depth.joint.overlap import Overlap, overlap
from room2dgs.depth.joint.residuals import at_points, view_residuals
from room2dgs.depth.joint.room_axes import room_axes
from room2dgs.torch_threads import one_torch_thread


class Stage(NamedTuple):
    """One grid size.

    Attributes:
        rows, columns: knots of each view's grid.
        steps: of Adam.
        rate: its first rate, in logarithms of depth.
        view_width: relative difference between two views at which a residual starts to count as an outlier.
        plane_width: likewise for the deviation of a textureless region from a plane.
        manhattan: estimate the room's axes, and use the Manhattan prior.
    """

    rows: int
    columns: int
    steps: int
    rate: float
    view_width: float
    plane_width: float
    manhattan: bool = False


STAGES = (
    Stage(3, 4, 150, 0.03, 0.15, 0.05),
    Stage(6, 8, 150, 0.03, 0.08, 0.05),
    Stage(12, 16, 300, 0.03, 0.05, 0.03),
    Stage(12, 16, 200, 0.02, 0.05, 0.02, manhattan=True),
    Stage(24, 32, 200, 0.01, 0.05, 0.02, manhattan=True),
)
LAST_RATE = 0.02  # of the first one, reached exponentially
POINT_WIDTH = 0.03  # relative depth error of a sparse point
OUTLIER_ERROR = 0.05  # relative depth error beyond which a sparse point counts as an outlier
SLOPE_WIDTH = 0.3  # sine between the surface and the normal prior's plane
AXIS_WIDTH = 0.1  # sine
POINT_WEIGHT, VIEW_WEIGHT, SLOPE_WEIGHT, PLANE_WEIGHT, AXIS_WEIGHT = 6.0, 15.0, 4.0, 1.0, 1.0
# Chosen with the maps of a network (CHANGELOG.md): its normals and what its views share are better than its depth.
# Smoothness acts on second differences of the grid, magnitude on the log-scale itself.
SMOOTHNESS_WEIGHT, MAGNITUDE_WEIGHT = 8.0, 0.3
MIN_STIFFNESS = 0.1  # where the confidence is 0: the regulariser must hold the grid where no data term does
# Samples of each kind in a step, for each view and in all.
SAMPLES_A_VIEW, SAMPLES = 64, (2000, 16000)


class JointDepths(NamedTuple):
    """Result of `joint_depths`.

    Attributes:
        depths: frame name -> (H, W) float32 metres, 0 = invalid; made when asked for.
        between_views: median relative difference where two views see the same, before and after; NaN without pairs.
        at_points: median relative difference to the sparse points, before and after; NaN without points.
        outlier_ratio: share of the sparse points with a relative error above `OUTLIER_ERROR`; NaN without points.
    """

    depths: Mapping[str, np.ndarray]
    between_views: tuple[float, float]
    at_points: tuple[float, float]
    outlier_ratio: float


@one_torch_thread()
def joint_depths(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    points: PointCloud,
    manhattan: bool = True,
    depth_confidences: Mapping[str, np.ndarray] | None = None,
    normal_confidences: Mapping[str, np.ndarray] | None = None,
) -> JointDepths:
    """Optimise the depth maps of some frames jointly; the same input gives the same bits.

    Args:
        frames: training views; those without a map in `depths` are passed over.
        depths: frame name -> (H, W) float32, metres, aligned view by view (`align`), 0 = invalid.
        normals: frame name -> (H, W, 3) float32, unit, world frame; may be empty.
        points: sparse points, metres.
        manhattan: textureless walls and floors that nearly face one of the room's axes are pulled to face it.
        depth_confidences, normal_confidences: frame name -> (H, W) in 0..1; 1 for the other frames. Where that
            of a depth is low, its grid is less stiff and its residuals to other views weigh less.
    """
    frames = [frame for frame in frames if frame.name in depths]
    if not frames:
        return JointDepths({}, (float("nan"),) * 2, (float("nan"),) * 2, float("nan"))
    views = overlap(frames, depths, normals, points, depth_confidences, normal_confidences)
    start = torch.zeros(len(views), STAGES[0].rows, STAGES[0].columns, dtype=torch.float32)
    grid = start
    for stage in STAGES:
        grid = log_scale_grid.finer(grid, stage.rows, stage.columns)
        grid = _solved(views, grid, stage, room_axes(views, grid) if manhattan and stage.manhattan else None)
    optimised: LazyMaps[np.ndarray] = LazyMaps()
    for frame, knots in zip(frames, grid, strict=True):
        optimised.add(frame.name, partial(_scaled, depths, frame.name, knots))
    before, after = _differences(views, start), _differences(views, grid)
    return JointDepths(optimised, (before[0], after[0]), (before[1], after[1]), after[2])


@one_torch_thread()
def _scaled(depths: Mapping[str, np.ndarray], name: str, knots: Tensor) -> np.ndarray:
    depth = depths[name]
    scale = torch.exp(log_scale_grid.whole(knots, *depth.shape)).numpy()
    return (depth * scale).astype(np.float32)


def _solved(views: Overlap, start: Tensor, stage: Stage, axes: Tensor | None) -> Tensor:
    grid = start.clone(memory_format=torch.contiguous_format)
    gradient, first, second = (torch.zeros_like(grid) for _ in range(3))
    energy = Energy(views, weights_of(stage), _stiffness(views, stage), axes)
    generator = torch.Generator().manual_seed(0)
    count = int(np.clip(SAMPLES_A_VIEW * len(views), *SAMPLES))
    for step in range(stage.steps):
        energy.gradient(grid, drawn(views, count, generator, axes is not None), gradient)
        rate = stage.rate * LAST_RATE ** (step / stage.steps)
        values, moments = grid.view(-1), (first.view(-1), second.view(-1))
        _C.adam(values, gradient.view(-1), *moments, rate, step + 1)  # type: ignore[arg-type]  # any array will do
    return grid


def weights_of(stage: Stage) -> Weights:
    """What the energy's terms weigh at this grid size."""
    terms = torch.tensor([POINT_WEIGHT, VIEW_WEIGHT, SLOPE_WEIGHT, PLANE_WEIGHT, AXIS_WEIGHT], dtype=torch.float32)
    widths = (POINT_WIDTH, stage.view_width, SLOPE_WIDTH, stage.plane_width, AXIS_WIDTH)
    return Weights(terms, torch.tensor(widths, dtype=torch.float32), SMOOTHNESS_WEIGHT, MAGNITUDE_WEIGHT)


def _stiffness(views: Overlap, stage: Stage) -> Tensor:
    """(V, rows, columns) weight of the regulariser at each knot: the mean confidence in the depth around it."""
    size = (stage.rows, stage.columns)
    mean = torch.nn.functional.interpolate(views.depth_confidence[:, None], size=size, mode="area")[:, 0]
    return mean.clamp(min=MIN_STIFFNESS)


def _differences(views: Overlap, grid: Tensor) -> tuple[float, float, float]:
    """Median absolute relative differences between views and at the points, and the share of points that are off by
    more than `OUTLIER_ERROR`; NaN without any."""
    generator, count = torch.Generator().manual_seed(1), SAMPLES[1]

    def some(number: int) -> Tensor:
        return torch.randint(number, (count,), generator=generator)

    between = points = grid.new_zeros(0)
    if len(views.pairs):
        between = view_residuals(
            views, grid, torch.stack([some(n) for n in (len(views.pairs), *views.depth.shape[1:])])
        )[0]
    # of the points that the photos are known to have seen; of all where nobody knows
    known = views.point_tracked.nonzero()[:, 0] if views.point_tracked.any() else torch.arange(len(views.point_view))
    if len(known):
        points = at_points(views, grid, known[some(len(known))]).abs()
    apart, off = (float(part.abs().median()) if len(part) else float("nan") for part in (between, points))
    return apart, off, float((points > OUTLIER_ERROR).float().mean()) if len(points) else float("nan")
