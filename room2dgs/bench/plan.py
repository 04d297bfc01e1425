"""Plans of runs of made rooms against the truth: walls, rooms, doors and windows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from room2dgs.bench.plan_truth import PlanTruth, TrueOpening
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.opening import Opening
from room2dgs.plan.svg import opening_ends
from room2dgs.report.table import NOTHING, Table, table

NEAR_M = 0.1  # of the truth: what is right
STEP_M = 0.05  # between places on a wall
ALIGNED = 0.98  # cosine, of walls
OFF_WALL_M = 0.35  # of an opening from its true wall: the wall may have been seen from its other side
SAME_ROOM = 0.5  # of the area of both rooms together
KINDS = {"door": "doors", "passage": "doors", "window": "windows"}


@dataclass(frozen=True)
class Counts:
    """Of one capture and kind: how much was found, of the truth and of what was said.

    Attributes:
        kind: "walls" (metres of them), "rooms", "doors" or "windows", and "doors in part" or "doors not seen" of which
            photos do not show the rim.
        found: of the truth.
        right: of what was said.
    """

    capture: str
    kind: str
    truth: float
    found: float
    said: float
    right: float


class _Segment(NamedTuple):
    start: np.ndarray
    end: np.ndarray


class _Asked(NamedTuple):
    """A true opening: whether it is of the room that was filmed, and the share of its sides that photos show."""

    hole: _Hole
    own: bool
    seen: float


class _Hole(NamedTuple):
    """An opening by its ends in the plan and its heights, metres."""

    kind: str
    ends: np.ndarray
    low: float
    high: float


def counted(
    plan: FloorPlan | None, capture: str, truth: PlanTruth, seen: Sequence[float] | None = None
) -> list[Counts]:
    """What a plan has of the truth: of the main room all is asked for, of those behind its doors nothing is missed.

    Args:
        plan: in its level frame; None: there is none.
        seen: of each true opening, the share of its sides that photos show (`sides_seen`); None: all of them. Openings
            with less than all count apart, and what is said in their place is not held against the others.
    """
    own = [_Segment(wall.start, wall.end) for wall in truth.walls if wall.room == 0]
    every = [_Segment(wall.start, wall.end) for wall in truth.walls]
    said = [] if plan is None else list(_sides(plan))
    walls = Counts(capture, "walls", _length(own), _near(own, said), _length(said), _near(said, every))
    holes = [] if plan is None else [_hole(plan, one) for one in plan.openings if one.kind in KINDS]
    counts = [walls, _rooms(plan, capture, truth)]
    shares = [1.0] * len(truth.openings) if seen is None else seen
    known = [
        _Asked(_true_hole(one), one.wall.room == 0, share)
        for one, share in zip(truth.openings, shares, strict=True)
        if one.kind in KINDS
    ]
    for kind in ("doors", "windows"):
        mine = [one for one in holes if KINDS[one.kind] == kind]
        counts += _openings(capture, kind, mine, [one for one in known if KINDS[one.hole.kind] == kind])
    return counts


def _openings(capture: str, kind: str, said: Sequence[_Hole], known: Sequence[_Asked]) -> list[Counts]:
    """Of those that are seen, of those that are seen in part, and of those of which no photo shows a side.

    What lies in no one's place is held against those that are seen.
    """
    counts, left = [], list(said)
    for name, least, most in ((kind, 1.0, 2.0), (f"{kind} in part", 1e-9, 1.0), (f"{kind} not seen", 0.0, 1e-9)):
        these = [one for one in known if least <= one.seen < most]
        asked = [one.hole for one in these if one.own]
        found = sum(any(_same(one, other) for one in said) for other in asked)
        there = [any(_overlap(one, other.hole) > 0 for other in these) for one in left]
        right = sum(any(_same(one, other.hole) for other in these) for one in left)
        counts.append(Counts(capture, name, len(asked), found, sum(there), right))
        left = [one for one, here in zip(left, there, strict=True) if not here]
    return [replace(counts[0], said=counts[0].said + len(left)), *counts[1:]]


def scores(counts: Iterable[Counts]) -> dict[str, float]:
    """Precision, recall and F of several captures together."""
    found = list(counts)
    truth, hit = sum(one.truth for one in found), sum(one.found for one in found)
    said, right = sum(one.said for one in found), sum(one.right for one in found)
    recall, precision = hit / truth if truth else 0.0, right / said if said else 0.0
    both = precision + recall
    return {"precision": precision, "recall": recall, "f": 2 * precision * recall / both if both else 0.0}


def tables(counts: Sequence[Counts]) -> list[Table]:
    """Each capture, and all together."""
    columns = {
        "capture": lambda one: one.capture,
        "what": lambda one: one.kind,
        "truth": lambda one: f"{one.truth:.3g}",
        "found": lambda one: f"{one.found:.3g}",
        "said": lambda one: f"{one.said:.3g}",
        "right": lambda one: f"{one.right:.3g}",
    }
    rows = [one for one in counts if one.truth or one.said]
    there = {one.kind for one in rows}
    kinds = [kind for kind in dict.fromkeys(one.kind for one in counts) if kind in there]
    figures = [(kind, scores(one for one in counts if one.kind == kind)) for kind in kinds]
    together = {"what": lambda one: one[0], **{key: _figure(key) for key in ("precision", "recall", "f")}}
    return [table("Plans", columns, rows), table(f"Within {100 * NEAR_M:g} cm", together, figures)]


def as_json(counts: Sequence[Counts]) -> dict[str, Any]:
    kinds = list(dict.fromkeys(one.kind for one in counts))
    return {
        "scores": {kind: scores(one for one in counts if one.kind == kind) for kind in kinds},
        "captures": [asdict(one) for one in counts],
    }


def _figure(key: str):
    return lambda one: f"{one[1][key]:.2f}" if key in one[1] else NOTHING


def _in_world(plan: FloorPlan, points: Iterable[np.ndarray]) -> np.ndarray:
    """(N, 2) points of the plan in the truth's world, whose z is up."""
    flat = np.array(list(points)).reshape(-1, 2)
    return (np.column_stack([flat, np.zeros(len(flat))]) @ plan.level_from_world)[:, :2]


def _sides(plan: FloorPlan) -> Iterable[_Segment]:
    for room in plan.rooms:
        for side in (one for ring in (room.sides, *room.islands) for one in ring):
            if side.wall is not None:
                yield _Segment(*_in_world(plan, (side.start, side.end)))


def _length(segments: Sequence[_Segment]) -> float:
    return float(sum(np.linalg.norm(one.end - one.start) for one in segments))


def _near(these: Sequence[_Segment], those: Sequence[_Segment]) -> float:
    """Metres of these that lie along some of those."""
    total = 0.0
    for one in these:
        length = float(np.linalg.norm(one.end - one.start))
        along = (one.end - one.start) / max(length, 1e-9)
        places = one.start + (np.arange(STEP_M / 2, length, STEP_M))[:, None] * along
        near = np.zeros(len(places), bool)
        for other in those:
            reach = float(np.linalg.norm(other.end - other.start))
            way = (other.end - other.start) / max(reach, 1e-9)
            if abs(along @ way) < ALIGNED:
                continue
            at = np.clip((places - other.start) @ way, 0, reach)
            near |= np.linalg.norm(places - other.start - at[:, None] * way, axis=1) <= NEAR_M
        total += length * float(near.mean()) if len(near) else 0.0
    return total


def _rooms(plan: FloorPlan | None, capture: str, truth: PlanTruth) -> Counts:
    import shapely

    known = [shapely.Polygon(outline) for outline in truth.outlines]
    outlines = [] if plan is None else [_in_world(plan, [side.start for side in room.sides]) for room in plan.rooms]
    said = [shapely.Polygon(outline).buffer(0) for outline in outlines]

    def same(one, other) -> bool:
        return one.intersection(other).area > SAME_ROOM * one.union(other).area

    found = int(any(same(known[0], one) for one in said))
    right = sum(any(same(one, other) for other in known) for one in said)
    return Counts(capture, "rooms", 1, found, len(said), right)


def _hole(plan: FloorPlan, one: Opening) -> _Hole:
    return _Hole(one.kind, _in_world(plan, opening_ends(plan, one)), one.low_m, one.high_m)


def overlapping(plan: FloorPlan, one: TrueOpening) -> Opening | None:
    """What the plan has of the same kind in the same place, over half of both widths."""
    there = _true_hole(one)
    for mine in plan.openings:
        if KINDS.get(mine.kind) == KINDS.get(one.kind) and _overlap(_hole(plan, mine), there) > 0.5:
            return mine
    return None


def _overlap(one: _Hole, other: _Hole) -> float:
    """Shared width over the width of both together; 0 where they are of different walls."""
    along = other.ends[1] - other.ends[0]
    width = float(np.linalg.norm(along))
    at = np.sort((one.ends - other.ends[0]) @ along / width)
    off = np.abs((one.ends - other.ends[0]) @ np.array([-along[1], along[0]]) / width)
    shared = min(at[1], width) - max(at[0], 0.0)
    return shared / (max(at[1], width) - min(at[0], 0.0)) if off.max() <= OFF_WALL_M else 0.0


def _true_hole(one: TrueOpening) -> _Hole:
    ends = one.wall.start + np.array([[one.start_m], [one.end_m]]) * one.wall.along
    return _Hole(one.kind, ends, one.low_m, one.high_m)


def _same(one: _Hole, other: _Hole) -> bool:
    """Both ends within `NEAR_M` along the wall, and both heights; a door's wall may be seen from its other side."""
    along = other.ends[1] - other.ends[0]
    width = float(np.linalg.norm(along))
    along = along / width
    at = np.sort((one.ends - other.ends[0]) @ along)
    off = np.abs((one.ends - other.ends[0]) @ np.array([-along[1], along[0]]))
    sides = abs(at[0]) <= NEAR_M and abs(at[1] - width) <= NEAR_M and off.max() <= OFF_WALL_M
    return bool(sides and abs(one.low - other.low) <= NEAR_M and abs(one.high - other.high) <= NEAR_M)
