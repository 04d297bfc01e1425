"""What a plan of a random room should say: outlines, heights, doors, windows and niches, level tops of furniture."""

from __future__ import annotations

from typing import Any

import numpy as np

from room2dgs.demo_room.geometry import Patch
from room2dgs.tools.random_rooms.layout import RandomRoom
from room2dgs.tools.random_rooms.shell import Space

TOPS_M = 0.3, 1.2  # heights over the floor of the tops of furniture that are listed
TOP_M2 = 0.25  # area of one, at least
TOP_TAGS = ("table", "desk", "counter")


def plan_truth(room: RandomRoom) -> dict[str, Any]:
    """Plain values, metres, in the room's world: z up, the floor at 0, all planes of walls without what covers them."""
    return {
        "up": [0.0, 0.0, 1.0],
        "rooms": [_space(space) for space in room.spaces],
        "tops": [top for patch in room.patches if (top := _top(patch)) is not None],
    }


def _space(space: Space) -> dict[str, Any]:
    flat = float(np.ptp(space.profile[:, 1])) == 0
    return {
        "outline": np.round(space.outline, 9).tolist(),
        "height_m": round(float(space.profile[0, 1]), 9) if flat else None,
        "openings": [
            {
                "kind": one.kind,
                "wall": wall,
                "start_m": one.start,
                "end_m": one.end,
                "low_m": one.low,
                "high_m": one.high,
                "cut": cut,
            }
            for cut, by_wall in ((True, space.openings), (False, space.mounted))
            for wall, found in sorted(by_wall.items())
            for one in found
        ],
    }


def _top(patch: Patch) -> dict[str, Any] | None:
    """A flat top of a piece of furniture, large enough to be measured."""
    corners = patch.grid[[0, 0, -1, -1], [0, -1, -1, 0]]
    if patch.grid.shape[:2] != (2, 2) or np.ptp(corners[:, 2]) > 1e-6 or patch.tag not in TOP_TAGS:
        return None
    cross = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    if not (cross[2] > TOP_M2 and TOPS_M[0] < corners[0, 2] < TOPS_M[1]):
        return None
    return {"what": patch.tag, "height_m": float(corners[0, 2]), "corners": np.round(corners, 9).tolist()}
