"""A wall's plane moved to where what is seen behind it is the mirror image of the room before it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from room2dgs.mirrors.grid import BEFORE_M, BEHIND_M
from room2dgs.mirrors.sights import Sights
from room2dgs.mirrors.walls import Plane

RADII = 0.3, 0.3, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.1  # metres between an image and its partner, step by step
COLOR_M = 0.004  # metres that a level of colour counts as
ASKED, LEAST = 4000, 60  # images, and those that have a partner
TILT, OFF_M = np.cos(np.radians(8.0)), 0.15  # from the wall's plane, at the middle of what is seen through it


def settled(wall: Plane, sights: Sights) -> Plane | None:
    """None where nothing like a mirror image is near.

    Each step finds the nearest place of the room, in space and colour, to each image, and the plane that reflects one
    list best onto the other.
    """
    side = sights.point @ wall.normal - wall.offset_m
    ahead = sights.centre @ wall.normal - wall.offset_m > BEFORE_M
    behind = _some(np.flatnonzero(sights.measured & ahead & (side < -BEHIND_M)), ASKED)
    before = _some(np.flatnonzero(sights.measured & (side > BEHIND_M)), 50 * ASKED)
    if min(len(behind), len(before)) < LEAST:
        return None
    tree = KDTree(np.hstack([sights.point[before], COLOR_M * sights.color[before]]))
    place, color = sights.point[behind], COLOR_M * sights.color[behind]
    plane = wall
    for radius in RADII:
        off, nearest = tree.query(np.hstack([reflected(place, plane), color]), distance_upper_bound=radius)
        near = np.isfinite(off)
        if near.sum() < LEAST:
            return None
        plane = best_plane(place[near], sights.point[before[nearest[near]]], wall.normal)
    middle = place[near].mean(axis=0) - (place[near].mean(axis=0) @ wall.normal - wall.offset_m) * wall.normal
    moved = abs(float(plane.normal @ middle) - plane.offset_m)
    return plane if plane.normal @ wall.normal > TILT and moved < OFF_M else None


def best_plane(behind: np.ndarray, before: np.ndarray, towards: np.ndarray) -> Plane:
    """The plane whose reflection brings places (M, 3) nearest to their partners (M, 3), by least squares.

    With p and q about the middle of both lists, the sum of squares is a constant + 4 n' (sum of p q') n: n is the
    eigenvector of the least eigenvalue of the symmetric part.

    Args:
        towards: (3,) the side that the normal is to be on.
    """
    middle = (behind.mean(axis=0) + before.mean(axis=0)) / 2
    product = (behind - middle).T @ (before - middle)
    normal = np.linalg.eigh(product + product.T)[1][:, 0]
    normal = normal if normal @ towards > 0 else -normal
    return Plane(normal, float(normal @ middle))


def reflected(points: np.ndarray, plane: Plane) -> np.ndarray:
    """(N, 3) points on the other side of a plane."""
    return points - 2 * (points @ plane.normal - plane.offset_m)[:, None] * plane.normal


def _some(number: np.ndarray, most: int) -> np.ndarray:
    """Evenly chosen."""
    return number[:: max(1, -(-len(number) // most))]
