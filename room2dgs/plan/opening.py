"""A door, a window, a passage or a niche."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from room2dgs.lengths.length import Length


@dataclass(frozen=True)
class Opening:
    """A rectangle in a wall.

    Attributes:
        kind: "door", "passage", "window" or "niche".
        closed: a door that is shut.
        room, side: numbers of the plan's room and of its side, from 0.
        start_m, end_m: along the side from its start.
        low_m, high_m: above the floor.
        depth_m: behind the wall, where its back was seen; None: a room's depth.
        probability: that there is such an opening.
        width, height: with their standard deviations.
    """

    kind: str
    closed: bool
    room: int
    side: int
    start_m: float
    end_m: float
    low_m: float
    high_m: float
    depth_m: float | None
    probability: float
    width: Length
    height: Length

    def as_dict(self, unit: str) -> dict[str, Any]:
        """Plain values."""
        return {
            "kind": self.kind,
            "closed": self.closed,
            "start_m": self.start_m,
            "end_m": self.end_m,
            "low_m": self.low_m,
            "high_m": self.high_m,
            "depth_m": self.depth_m,
            "probability": self.probability,
            "width": self.width.as_dict(unit),
            "height": self.height.as_dict(unit),
        }
