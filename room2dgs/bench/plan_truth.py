"""What a made room's plan should say: plan_true.json of a capture, as `make_captures` writes it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.errors import InputError
from room2dgs.json_files import read_json

PLAN_TRUTH = "plan_true.json"


@dataclass(frozen=True)
class TrueWall:
    """One wall, seen from inside: from corner to corner, the room on its left.

    Attributes:
        start, end: (2,) metres.
        room: number of its room, the main one 0.
    """

    start: np.ndarray
    end: np.ndarray
    room: int

    @property
    def length_m(self) -> float:
        return float(np.linalg.norm(self.end - self.start))

    @property
    def along(self) -> np.ndarray:
        return (self.end - self.start) / self.length_m

    @property
    def normal(self) -> np.ndarray:
        """(2,) unit, into the room."""
        return np.array([-self.along[1], self.along[0]])

    @property
    def offset_m(self) -> float:
        return float(self.normal @ self.start)


@dataclass(frozen=True)
class TrueOpening:
    """A door, window or niche: metres along its wall and above the floor.

    Attributes:
        cut: the wall has a hole there; False: it is fixed on the wall.
    """

    kind: str
    wall: TrueWall
    start_m: float
    end_m: float
    low_m: float
    high_m: float
    cut: bool


@dataclass(frozen=True)
class PlanTruth:
    """Of a capture; metres, z up, the floor at 0.

    Attributes:
        outlines: (N, 2) of each room, counter-clockwise; the main one first.
        heights: of each room's flat ceiling; None: it is slanted.
        tops: (4, 3) corners of level tops of furniture, by what they are.
    """

    outlines: tuple[np.ndarray, ...]
    heights: tuple[float | None, ...]
    walls: tuple[TrueWall, ...]
    openings: tuple[TrueOpening, ...]
    tops: tuple[tuple[str, np.ndarray], ...]


def read_plan_truth(capture: Path) -> PlanTruth:
    """Of a capture's folder.

    Raises:
        InputError: it has none, or it is damaged.
    """
    path = capture / PLAN_TRUTH
    if not path.is_file():
        raise InputError(
            f"{path} is missing: only made rooms have one (python -m room2dgs.tools.make_captures); name runs of those"
        )
    try:
        return _truth(read_json(path))
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(f"{path} is no truth of a plan; make the capture again") from error


def _truth(found: dict[str, Any]) -> PlanTruth:
    outlines, heights, walls, openings = [], [], [], []
    for number, room in enumerate(found["rooms"]):
        outline = np.array(room["outline"], np.float64)
        ends = np.roll(outline, -1, axis=0)
        own = [TrueWall(start, end, number) for start, end in zip(outline, ends, strict=True)]
        outlines.append(outline)
        heights.append(None if room["height_m"] is None else float(room["height_m"]))
        walls += own
        openings += [_opening(one, own) for one in room["openings"]]
    tops = tuple((str(top["what"]), np.array(top["corners"], np.float64)) for top in found["tops"])
    return PlanTruth(tuple(outlines), tuple(heights), tuple(walls), tuple(openings), tops)


def _opening(one: dict[str, Any], walls: list[TrueWall]) -> TrueOpening:
    start_m, end_m, low_m, high_m = (float(one[key]) for key in ("start_m", "end_m", "low_m", "high_m"))
    return TrueOpening(str(one["kind"]), walls[one["wall"]], start_m, end_m, low_m, high_m, bool(one["cut"]))
