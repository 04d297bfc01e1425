"""Protocol `depth`: the surface's depth in each photo against the depth that a sensor measured there.

Each photo is compared in its own frame, by the pose that the reconstruction used for it. Drift between photos, and
drift of a true mesh's own poses, therefore do not count as errors of the surface: a wall may be 5 cm off in the world
and right in every photo. A photo that is off as a whole shows as its scale error.

- Pixels without a measured depth do not count, nor those that the photo's mask excludes.
- Pixels with a measured depth but without surface count as wrong in `within_*` and `delta1`; `coverage` is the share
  with surface. The relative errors are of pixels with both.
- A relative error is (surface - sensor) / sensor. `abs_rel` is the mean of its absolute value; `delta1` the share of
  pixels with max(surface / sensor, sensor / surface) < 1.25 (Eigen et al. 2014).
- Figures of several photos are means over the photos. A photo's scale error is the median of its signed relative
  errors; its 5th and 95th percentile over the photos say how far photos disagree in scale.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from room2dgs.eval.geometry_scores import threshold_name
from room2dgs.eval.protocol import MeshFile
from room2dgs.geometry.camera import Camera

THRESHOLDS_M = (0.02, 0.05, 0.10)
DELTA = 1.25
ALL, TRAINING, HELD_OUT = "all", "training", "held_out"
SHARES = ("coverage", *(f"within_{threshold_name(t)}" for t in THRESHOLDS_M), "abs_rel", "delta1")
ROWS = {
    **{f"within_{threshold_name(t)}": f"within {threshold_name(t)}" for t in THRESHOLDS_M},
    "coverage": "coverage",
    "abs_rel": "AbsRel",
    "delta1": "delta1",
    "scale_error_median": "scale error of a photo, median",
    "scale_error_p5": "scale error, 5th percentile",
    "scale_error_p95": "scale error, 95th percentile",
}

Figures: TypeAlias = dict[str, float | None]


@dataclass(frozen=True)
class DepthView:
    """A photo with measured depth.

    Attributes:
        camera: pose in the frame of the surface, metres.
        measured: reads the (H, W) z-depth at the camera's size, metres; 0 where nothing was measured or a mask
            excludes the pixel.
        held_out: the reconstruction did not use the photo.
    """

    name: str
    camera: Camera
    measured: Callable[[], np.ndarray]
    held_out: bool = False


# (H, W) z-depth of a surface in a view, metres; 0 where there is none
DepthOf: TypeAlias = Callable[[DepthView], np.ndarray]


@dataclass(frozen=True)
class DepthScores:
    """Scores by protocol `depth`.

    Attributes:
        by_view: photo's name -> figures: `pixels` (measured), `coverage`, `within_2cm`, `within_5cm`, `within_10cm`,
            `abs_rel`, `delta1`, and `signed_rel_p5`, `signed_rel_median`, `signed_rel_p95` of the relative error. A
            figure is None without a pixel to measure it on. Photos without measured depth are left out.
        held_out: names of photos that the reconstruction did not use.
    """

    by_view: dict[str, Figures]
    held_out: frozenset[str]

    @property
    def groups(self) -> dict[str, Figures]:
        """ "all", "training", "held_out" -> figures over the photos; only groups that have photos."""
        training = [figures for name, figures in self.by_view.items() if name not in self.held_out]
        held_out = [figures for name, figures in self.by_view.items() if name in self.held_out]
        groups = {ALL: [*training, *held_out], TRAINING: training, HELD_OUT: held_out}
        return {name: _over_views(views) for name, views in groups.items() if views}

    def as_dict(self) -> dict[str, Any]:
        """Plain values for metrics.json: the groups, and "by_view"."""
        views = {name: {**view, "held_out": name in self.held_out} for name, view in self.by_view.items()}
        return {**self.groups, "by_view": views}


def depth(depth_of: DepthOf, views: Sequence[DepthView]) -> DepthScores:
    """Score a surface by its depth in each view; views without measured depth are left out.

    Args:
        depth_of: of the surface, for example `mesh_depth(mesh)`.
    """
    by_view = {}
    for view in views:
        measured = view.measured()
        if (measured > 0).any():
            by_view[view.name] = view_figures(depth_of(view), measured)
    return DepthScores(by_view, frozenset(view.name for view in views if view.held_out))


def mesh_depth(mesh: MeshFile) -> DepthOf:
    """Depth of a mesh: the first face on the ray through each pixel's centre."""

    def depth_of(view: DepthView) -> np.ndarray:
        found = mesh.surface.seen_by(view.camera).t.reshape(view.camera.height, view.camera.width)
        return np.where(np.isfinite(found), found, np.float32(0))

    return depth_of


def view_figures(surface: np.ndarray, measured: np.ndarray) -> Figures:
    """Figures of one photo, see `DepthScores.by_view`.

    Args:
        surface, measured: (H, W) z-depth, metres; 0 where there is none. `measured` has some.
    """
    known = measured > 0
    found, truth = surface[known].astype(np.float64), measured[known].astype(np.float64)
    covered = found > 0
    off = np.where(covered, np.abs(found - truth), np.inf)
    relative = (found[covered] - truth[covered]) / truth[covered]
    ratio = np.maximum(found[covered] / truth[covered], truth[covered] / found[covered])
    figures: Figures = {"pixels": float(known.sum()), "coverage": float(covered.mean())}
    figures |= {f"within_{threshold_name(t)}": float((off < t).mean()) for t in THRESHOLDS_M}
    figures["abs_rel"] = float(np.abs(relative).mean()) if len(relative) else None
    figures["delta1"] = float((ratio < DELTA).sum() / len(truth))
    low, middle, high = np.percentile(relative, (5, 50, 95)) if len(relative) else (None, None, None)
    ends = {"signed_rel_p5": low, "signed_rel_median": middle, "signed_rel_p95": high}
    return figures | {name: None if value is None else float(value) for name, value in ends.items()}


def depth_table(groups: dict[str, Figures], surface: str) -> str:
    """A table for a terminal, a column for the training photos and one for those held out.

    Args:
        groups: as `DepthScores.groups`.
        surface: what was measured: "mesh" or "surfels".
    """
    columns = {
        f"{name.replace('_', '-')} ({groups[name]['views']:.0f})": [shown(key, groups[name].get(key)) for key in ROWS]
        for name in (TRAINING, HELD_OUT)
        if name in groups
    }
    frame = pd.DataFrame(columns, index=pd.Index(ROWS.values(), name=f"depth of the {surface}, by the sensor's"))
    align = ("left", *("right" for _ in columns))
    return frame.to_markdown(tablefmt="simple_outline", disable_numparse=True, colalign=align)


def shown(key: str, value: float | None) -> str:
    """A figure of `DepthScores.groups` as text: scale errors in percent."""
    if value is None:
        return "-"
    return f"{value:+.1%}" if key.startswith("scale_error_") else f"{value:.3f}"


def _over_views(views: Sequence[Figures]) -> Figures:
    """Means over the photos that have a figure, and the spread of their scale errors."""
    figures: Figures = {"views": float(len(views))}
    for key in SHARES:
        known = [value for view in views if (value := view[key]) is not None]
        figures[key] = float(np.mean(known)) if known else None
    scale = [value for view in views if (value := view["signed_rel_median"]) is not None]
    low, middle, high = map(float, np.percentile(scale, (5, 50, 95))) if scale else (None, None, None)
    return figures | {"scale_error_median": middle, "scale_error_p5": low, "scale_error_p95": high}
