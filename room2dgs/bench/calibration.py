"""Expected against true errors of meshes: whether they are right in size, and rank better than a count of views."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.bench.matched_surface import Matched, matched_views
from room2dgs.bench.prior_scores import Ranking, ranking
from room2dgs.errors import InputError
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, MEASURED, SOURCE, VIEWS, told_by
from room2dgs.report.table import NOTHING, Table, table
from room2dgs.runs.folder import MESH, TRUST, required
from room2dgs.runs.trust import read_trust

if TYPE_CHECKING:
    import trimesh

    from room2dgs.config import Config
    from room2dgs.eval.sampling import Samples

FARTHEST_M = 0.5  # from the truth: what is farther off has no truth of its own there
LEAST = 50  # samples of a part that is listed
VIEW_BOUNDS = {"1-2 views": (1, 2), "3-5 views": (3, 5), "6+ views": (6, 255)}
# by the consistent views of stereo's depth; without one, depth is of networks and planes, or of a depth camera
MATCHED_BOUNDS = {"stereo of 3+ views": (3, 255), "stereo of 1-2 views": (1, 2)}


@dataclass(frozen=True)
class SurfaceErrors:
    """Samples of a mesh, spread by area; N of them.

    Attributes:
        expected: (N,) metres, one standard deviation.
        true: (N,) metres to the truth.
        views: (N,) how many have seen the place.
        measured: (N,) bool; False: it was inferred from what is around it.
        matched: what the depth there rests on; None: the run does not tell.
    """

    expected: np.ndarray
    true: np.ndarray
    views: np.ndarray
    measured: np.ndarray
    matched: Matched | None = None

    def of(self, which: np.ndarray) -> SurfaceErrors:
        matched = None if self.matched is None else Matched(*(one[which] for one in self.matched))
        return SurfaceErrors(self.expected[which], self.true[which], self.views[which], self.measured[which], matched)


@dataclass(frozen=True)
class Calibration:
    """One part of a mesh.

    Attributes:
        share: of the surface's samples.
        expected_m, true_m: medians.
        within: shares of the samples whose true error is at most 1, 2 and 3 expected ones; 0.68, 0.95 and 0.997 of a
            normal distribution.
        ranking: by the expected error; None: too few samples.
        by_views: the same by the number of views, few first.
    """

    share: float
    expected_m: float
    true_m: float
    within: tuple[float, float, float]
    ranking: Ranking | None
    by_views: Ranking | None


def run_errors(config: Config) -> SurfaceErrors:
    """Of the mesh of the run in config.out: samples as protocol `area` has them, of what the cameras saw.

    Raises:
        InputError: no mesh, no truth, or a mesh that does not say how sure it is.
    """
    from room2dgs.eval.protocol import Options
    from room2dgs.eval.protocol_area import compared
    from room2dgs.eval.surface import Surface
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.pipeline.scene import scene_of_run
    from room2dgs.pipeline.truth import truth_in_scene

    out = Path(config.out)
    scene = scene_of_run(config)
    if scene.gt_mesh is None:
        raise InputError(f"{scene.path} has no gt_mesh.ply to compare the mesh of {out} with; name other runs")
    mesh = read_in_scene(required(out / MESH, "mesh"), scene.origin_m)
    if told_by(mesh, EXPECTED_ERROR) is None:
        raise InputError(f"{out / MESH} does not say how sure it is; make it again with `room2dgs mesh {out}`")
    settings = config.eval
    options = Options(threshold_m=settings.threshold_m, samples=settings.samples, seed=settings.seed)
    truth = truth_in_scene(scene.gt_mesh, scene).surface
    found = compared(mesh, Surface(mesh), truth, truth, [frame.camera for frame in scene.frames], options)
    errors, trust = errors_at(mesh, found.samples, found.distance), read_trust(out / TRUST)
    if trust:
        errors = replace(errors, matched=matched_views(found.samples.points, scene.train, trust))
    return errors.of(errors.true < FARTHEST_M)


def errors_at(mesh: trimesh.Trimesh, samples: Samples, distance: np.ndarray) -> SurfaceErrors:
    """Of samples of a mesh.

    Args:
        mesh: with its expected errors.
        distance: (N,) metres to the truth.
    """
    corners = np.asarray(mesh.faces)[samples.triangle]
    weights = barycentric(np.asarray(mesh.vertices)[corners], samples.points)
    told = told_by(mesh, EXPECTED_ERROR)
    assert told is not None
    expected = (weights * told[corners]).sum(axis=1)
    nearest = np.take_along_axis(corners, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    views, source = told_by(mesh, VIEWS), told_by(mesh, SOURCE)
    seen = np.zeros(len(nearest)) if views is None else views[nearest]
    measured = np.ones(len(nearest), bool) if source is None else source[nearest] == MEASURED
    return SurfaceErrors(expected, distance, seen, measured)


def barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N, 3) weights, 0..1, of the corners (N, 3, 3) of triangles for points (N, 3) on them."""
    first, second, at = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    normal = np.cross(first, second)
    square = np.maximum((normal**2).sum(axis=1), 1e-30)
    u = (np.cross(at, second) * normal).sum(axis=1) / square
    v = (np.cross(first, at) * normal).sum(axis=1) / square
    weights = np.stack([1 - u - v, u, v], axis=1).clip(0, 1)
    return weights / weights.sum(axis=1, keepdims=True)


def parts(errors: SurfaceErrors) -> dict[str, np.ndarray]:
    """The whole mesh and its parts, by name: (N,) bool each."""
    found = {"all": np.ones(len(errors.true), bool), "measured": errors.measured, "inferred": ~errors.measured}
    for name, (least, most) in VIEW_BOUNDS.items():
        found[name] = errors.measured & (errors.views >= least) & (errors.views <= most)
    if errors.matched is not None:
        for name, (least, most) in MATCHED_BOUNDS.items():
            found[name] = errors.measured & (errors.matched.views >= least) & (errors.matched.views <= most)
        bare = errors.measured & (errors.matched.views == 0)
        found["planes without stereo"] = bare & errors.matched.on_plane
        found["other without stereo"] = bare & ~errors.matched.on_plane
    return found


def calibrations(errors: SurfaceErrors) -> dict[str, Calibration]:
    """Of the whole mesh and of its parts that have `LEAST` samples at least."""
    count = len(errors.true)
    return {
        name: calibration(errors.of(which), which.sum() / count)
        for name, which in parts(errors).items()
        if which.sum() >= LEAST
    }


def calibration(errors: SurfaceErrors, share: float = 1.0) -> Calibration:
    """Of samples, at least one."""
    one, two, three = (float((errors.true <= times * errors.expected).mean()) for times in (1, 2, 3))
    return Calibration(
        float(share),
        float(np.median(errors.expected)),
        float(np.median(errors.true)),
        (one, two, three),
        ranking(errors.expected, errors.true),
        ranking(-errors.views.astype(np.float64), errors.true),
    )


Found = Mapping[str, Mapping[str, Calibration]]


def tables(found: Found) -> list[Table]:
    """Parts of all runs, then tenths of the surface by the expected error.

    Args:
        found: run -> part -> its calibration.
    """
    rows = [(run, part, one) for run, of_run in found.items() for part, one in of_run.items()]
    tenths = [
        (run, number + 1, low_high)
        for run, of_run in found.items()
        if "all" in of_run and (order := of_run["all"].ranking) is not None
        for number, low_high in enumerate(order.bins)
    ]
    return [
        table("Expected and true errors of the surface", _PARTS, rows),
        table("Tenths of the surface by the expected error", _TENTHS, tenths),
    ]


def as_json(found: Found) -> dict[str, object]:
    return {run: {part: asdict(one) for part, one in of_run.items()} for run, of_run in found.items()}


def _millimetres(value: float) -> str:
    return f"{1000 * value:.1f} mm"


def _ause(order: Ranking | None) -> str:
    return NOTHING if order is None else f"{order.ause:.3f}"


_PARTS: dict[str, Callable] = {
    "run": lambda row: row[0],
    "surface": lambda row: row[1],
    "share": lambda row: f"{row[2].share:.1%}",
    "expected": lambda row: _millimetres(row[2].expected_m),
    "true": lambda row: _millimetres(row[2].true_m),
    "within 1 σ": lambda row: f"{row[2].within[0]:.2f}",
    "2 σ": lambda row: f"{row[2].within[1]:.2f}",
    "3 σ": lambda row: f"{row[2].within[2]:.2f}",
    "AUSE": lambda row: _ause(row[2].ranking),
    "by views": lambda row: _ause(row[2].by_views),
    "of no order": lambda row: NOTHING if row[2].ranking is None else f"{row[2].ranking.ause_random:.3f}",
}
_TENTHS: dict[str, Callable] = {
    "run": lambda row: row[0],
    "tenth": lambda row: str(row[1]),
    "expected, mean": lambda row: _millimetres(row[2][0]),
    "true, mean": lambda row: _millimetres(row[2][1]),
}
