"""Lengths of runs of made rooms against the truth: signed error, deviation, how often that holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations, product
from pathlib import Path

import numpy as np

from room2dgs.bench.plan_truth import PlanTruth, TrueWall, read_plan_truth
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.lengths.between import plane_to_plane
from room2dgs.lengths.length import Length
from room2dgs.lengths.surface import FoundPlane
from room2dgs.lengths.targets import Target
from room2dgs.pipeline.measure import MeasuredRun
from room2dgs.report.table import NOTHING, Table, table

SAME_DEG, SAME_M = 5.0, 0.15  # a plane of the plan is a true wall within these
OPPOSITE = -0.999  # cosine of the walls' normals
FACING_M = 0.3  # of two walls that lie opposite each other, at least
SPREAD = 0.1, 0.3, 0.5, 0.7, 0.9  # along the sides of a top, where it is looked for
LEVEL_DEG = 30.0  # of the mesh there
SAME_TOP_M = 0.02  # heights of one plane


@dataclass(frozen=True)
class Row:
    """One length.

    Attributes:
        kind: "walls", "height", "doors", "windows" or "top".
        value, sigma: metres, as measured; None: it was not found.
    """

    capture: str
    kind: str
    what: str
    truth: float
    value: float | None
    sigma: float | None

    @property
    def error(self) -> float | None:
        return None if self.value is None else self.value - self.truth


def measured_rows(run: MeasuredRun, capture: str, truth: PlanTruth) -> list[Row]:
    """All lengths of a made room that a run can be asked for; none is found where no plan came out."""
    try:
        has_plan = bool(run.plan.rooms)
    except InputError as error:
        run.source.log(f"{capture}: {error}")
        has_plan = False
    rows = [*_heights(run, capture, truth, has_plan), *_walls(run, capture, truth, has_plan)]
    return [
        *rows,
        *(_openings(run, capture, truth) if has_plan else ()),
        *(_tops(run, capture, truth) if has_plan else ()),
    ]


def truth_of(config: Config) -> PlanTruth:
    """Of the capture of a run.

    Raises:
        InputError: it is no made room.
    """
    return read_plan_truth(Path(config.scene.path))


def summary(rows: Sequence[Row]) -> dict[str, float | int]:
    """How far off lengths are, and how often their deviations hold."""
    found = [(row.error, row.sigma) for row in rows if row.error is not None and row.sigma is not None]
    if not found:
        return {"lengths": len(rows), "found": 0}
    error, sigma = np.array(found).T
    off = np.abs(error)
    return {
        "lengths": len(rows),
        "found": len(found),
        "median_m": float(np.median(off)),
        "p95_m": float(np.quantile(off, 0.95)),
        "bias_m": float(np.median(error)),
        "within_1_sigma": float((off <= sigma).mean()),
        "within_2_sigma": float((off <= 2 * sigma).mean()),
        "sigma_median_m": float(np.median(sigma)),
    }


def tables(rows: Sequence[Row]) -> list[Table]:
    """Each length, and the figures by kind."""
    columns = {
        "length": lambda row: f"{row.capture}, {row.what}",
        "truth": lambda row: f"{row.truth:.3f} m",
        "error": lambda row: NOTHING if row.error is None else f"{1000 * row.error:+.1f} mm",
        "±": lambda row: NOTHING if row.sigma is None else f"{1000 * row.sigma:.1f} mm",
    }
    kinds = ["all", *dict.fromkeys(row.kind for row in rows)]
    figures = [(kind, summary([row for row in rows if kind in ("all", row.kind)])) for kind in kinds]
    return [table("Lengths", columns, rows), table("Figures", _FIGURES, figures)]


def as_json(rows: Sequence[Row]) -> dict[str, object]:
    return {"summary": summary(rows), "lengths": [{**asdict(row), "error": row.error} for row in rows]}


def _millimetres(key: str):
    return lambda one: f"{1000 * one[1][key]:.1f} mm" if key in one[1] else NOTHING


def _share(key: str):
    return lambda one: f"{one[1][key]:.2f}" if key in one[1] else NOTHING


_FIGURES = {
    "kind": lambda one: one[0],
    "found": lambda one: f"{one[1]['found']} of {one[1]['lengths']}",
    "median": _millimetres("median_m"),
    "95 %": _millimetres("p95_m"),
    "bias": _millimetres("bias_m"),
    "median ±": _millimetres("sigma_median_m"),
    "within 1 σ": _share("within_1_sigma"),
    "within 2 σ": _share("within_2_sigma"),
}


def _row(capture: str, kind: str, what: str, truth: float, length: Length | None) -> Row:
    if length is None:
        return Row(capture, kind, what, truth, None, None)
    return Row(capture, kind, what, truth, length.value, length.sigma)


def _heights(run: MeasuredRun, capture: str, truth: PlanTruth, has_plan: bool) -> Iterator[Row]:
    if truth.heights[0] is not None:
        yield _row(capture, "height", "height", truth.heights[0], run.plan.height if has_plan else None)


def _walls(run: MeasuredRun, capture: str, truth: PlanTruth, has_plan: bool) -> Iterator[Row]:
    """Pairs of walls of the main room that lie opposite each other."""
    walls = run.plan.walls if has_plan else ()
    planes = {wall.name: run.plane(Target(wall.name, name=wall.name, plane=True)) for wall in walls}
    own = [wall for wall in truth.walls if wall.room == 0]
    for one, other in combinations(range(len(own)), 2):
        distance = _opposite(own[one], own[other])
        if distance is None:
            continue
        found = [_plane_of(own[index], planes.values()) for index in (one, other)]
        length = None
        if found[0] is not None and found[1] is not None:
            length = plane_to_plane(found[0], found[1], run.scale.sigma)
        yield _row(capture, "walls", f"wall {one} to {other}", distance, length)


def _opposite(one: TrueWall, other: TrueWall) -> float | None:
    """Metres between two walls that look at each other over `FACING_M` at least."""
    if one.normal @ other.normal > OPPOSITE:
        return None
    distance = -(one.offset_m + other.offset_m)
    reach = [np.sort([wall.start @ one.along, wall.end @ one.along]) for wall in (one, other)]
    shared = min(reach[0][1], reach[1][1]) - max(reach[0][0], reach[1][0])
    return float(distance) if distance > 0 and shared >= FACING_M else None


def _plane_of(wall: TrueWall, planes) -> FoundPlane | None:
    """The plane of the plan that is nearest to a true wall."""
    near = []
    for plane in planes:
        off = abs(float(plane.normal[:2] @ (wall.start + wall.end) / 2) - plane.offset_m)
        if plane.normal[:2] @ wall.normal > np.cos(np.radians(SAME_DEG)) and off < SAME_M:
            near.append((off, plane))
    return min(near, key=lambda one: one[0])[1] if near else None


def _openings(run: MeasuredRun, capture: str, truth: PlanTruth) -> Iterator[Row]:
    """Widths and heights of doors and windows of the main room, of those that the plan has about there."""
    from room2dgs.bench.plan import KINDS, overlapping

    for number, one in enumerate(one for one in truth.openings if one.wall.room == 0 and one.kind in KINDS):
        found = overlapping(run.plan_with_openings, one)
        width, height = (None, None) if found is None else (found.width, found.height)
        what = f"{one.kind} {number}"
        yield _row(capture, KINDS[one.kind], f"{what}, width", one.end_m - one.start_m, width)
        yield _row(capture, KINDS[one.kind], f"{what}, height", one.high_m - one.low_m, height)


def _tops(run: MeasuredRun, capture: str, truth: PlanTruth) -> Iterator[Row]:
    """Heights of tops over the floor, where the mesh has one."""
    floor = run.plane(Target("floor", name="floor", plane=True))
    for number, (what, corners) in enumerate(truth.tops):
        height = float(corners[0, 2])
        yield _row(capture, "top", f"{what} {number}", height, _top(run, floor, corners, what))


def _top(run: MeasuredRun, floor: FoundPlane, corners: np.ndarray, what: str) -> Length | None:
    """Of the level plane that most places of it show: things stand on the others."""
    planes = [plane for at in _spread(corners) if (plane := _level_plane(run, at, what)) is not None]
    if not planes:
        return None
    height = np.array([plane.middle @ floor.normal for plane in planes])
    alike = np.abs(height[:, None] - height) < SAME_TOP_M
    most = np.flatnonzero(alike[alike.sum(axis=1).argmax()])
    largest = max(most, key=lambda one: planes[one].sigma.area_m2)
    return plane_to_plane(floor, planes[largest], run.scale.sigma)


def _spread(corners: np.ndarray) -> Iterator[np.ndarray]:
    """Points of a parallelogram, of four corners in order."""
    for one, other in product(SPREAD, repeat=2):
        yield corners[0] + one * (corners[1] - corners[0]) + other * (corners[3] - corners[0])


def _level_plane(run: MeasuredRun, point: np.ndarray, what: str) -> FoundPlane | None:
    try:
        spot = run.surface.nearest(point, what)
    except InputError:
        return None
    if spot.normal[2] < np.cos(np.radians(LEVEL_DEG)):
        return None
    plane = run.surface.plane_around(spot, what)
    return plane if plane.normal[2] > np.cos(np.radians(SAME_DEG)) else None
