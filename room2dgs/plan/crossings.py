"""Rays that meet a wall's plane, or end near it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.outline import Side
from room2dgs.plan.sight import Rays

THROUGH_M = 0.07  # behind a wall's plane: what a view sees there it sees through an opening
BEFORE_M = 0.025, 0.075  # of a closed door before its wall
ON_WALL_M = 0.035  # of a wall's plane: a ray that ends there meets the wall
SIGHT_M = 0.2  # before a wall: from where it is seen
LARGEST_SIGMA_M = 0.15


class Crossings(NamedTuple):
    """C of them: metres along the side and above the floor.

    Attributes:
        behind_m: how far behind the plane the ray ends; negative: before it.
        through: it ends behind the plane.
        on: it ends on the wall.
        before: it ends a door's thickness before it.
        view: number of the view.
    """

    along: np.ndarray
    up: np.ndarray
    behind_m: np.ndarray
    through: np.ndarray
    on: np.ndarray
    before: np.ndarray
    view: np.ndarray

    def of(self, which: np.ndarray) -> Crossings:
        """Some of them."""
        return Crossings(*(part[which] for part in self))


def crossings(plan: FloorPlan, side: Side, rays: Rays, top_m: float) -> Crossings:
    """Of the wall of a side, up to a height over the floor.

    Args:
        rays: in the plan's level frame.
    """
    wall = plan.walls[side.wall or 0]
    along = np.append((side.end - side.start) / side.length_m, 0.0)
    origin, end = (places @ wall.normal - wall.offset_m for places in (rays.origin, rays.end))
    reach = np.maximum(BEFORE_M[1], np.minimum(rays.sigma_m, LARGEST_SIGMA_M))
    seen = (origin > SIGHT_M) & (end < reach)
    share = np.where(end < 0, origin / np.maximum(origin - end, 1e-9), 1.0)[seen]
    place = rays.origin[seen] + share[:, None] * (rays.end[seen] - rays.origin[seen])
    x, z = place @ along - side.start @ along[:2], place[:, 2] - plan.floor.offset_m
    behind, sigma = -end[seen], rays.sigma_m[seen]
    through = behind > np.maximum(THROUGH_M, 1.5 * sigma)
    on = ~through & (np.abs(behind) < np.maximum(ON_WALL_M, np.minimum(sigma, THROUGH_M)))
    before = (behind < -BEFORE_M[0]) & (behind > -BEFORE_M[1])
    inside = (x >= 0) & (x <= side.length_m) & (z >= 0) & (z <= top_m)
    return Crossings(x, z, behind, through, on, before, rays.view[seen]).of(inside)
