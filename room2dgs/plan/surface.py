"""A mesh in a level frame: x and y across the floor, z up; the walls along x and y where most of them allow it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh

from room2dgs.geometry.cells import cell_indices
from room2dgs.lengths.surface_error import expected_errors, face_weight

SLANTED_DEG = 20.0  # faces of a slanted ceiling lean at least so far, from level and from upright
UPRIGHT_DEG = 12.0  # faces that lean less are of walls
LEVEL_DEG = 12.0
BIN_DEG = 1.0
CELL_M = 0.08  # within which faces that look the same way share a normal
WINDOW_DEG = 6.0


@dataclass(frozen=True)
class LevelSurface:
    """The faces of a mesh that have an area, F of them.

    Attributes:
        level_from_world: (3, 3) rotation.
        middle, normal: (F, 3) in the level frame; normals point to the side that was seen.
        area: (F,) square metres.
        weight: (F,) of each in the place of a plane (`face_weight`); the area where the mesh says no errors.
    """

    level_from_world: np.ndarray
    middle: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    weight: np.ndarray

    @property
    def upright(self) -> np.ndarray:
        """(F,) bool: faces that may be a wall's."""
        return np.abs(self.normal[:, 2]) < np.sin(np.radians(UPRIGHT_DEG))

    @property
    def upward(self) -> np.ndarray:
        """(F,) bool: faces that may be the floor's."""
        return self.normal[:, 2] > np.cos(np.radians(LEVEL_DEG))

    @property
    def downward(self) -> np.ndarray:
        """(F,) bool: faces that may be the ceiling's."""
        return self.normal[:, 2] < -np.cos(np.radians(LEVEL_DEG))

    @property
    def overhanging(self) -> np.ndarray:
        """(F,) bool: faces that may be a slanted ceiling's."""
        steep, flat = np.sin(np.radians(SLANTED_DEG)), np.cos(np.radians(SLANTED_DEG))
        return (self.normal[:, 2] < -steep) & (self.normal[:, 2] > -flat)


def level_surface(mesh: trimesh.Trimesh, up: np.ndarray) -> LevelSurface:
    """The mesh's faces in the level frame, turned about up so that most walls face along x or y.

    Args:
        mesh: world frame; its faces wind counter-clockwise seen from where they were seen.
        up: (3,) unit, world.
    """
    corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(cross, axis=1)
    good = doubled > 0
    middle, area = corners[good].mean(axis=1), doubled[good] / 2
    normal = _calm(middle, cross[good])
    across = np.array([1.0, 0, 0]) if abs(up[0]) < 0.9 else np.array([0, 1.0, 0])
    right = across - (across @ up) * up
    right /= np.linalg.norm(right)
    first = np.stack([right, np.cross(up, right), up])
    walls = np.abs(normal @ up) < np.sin(np.radians(UPRIGHT_DEG))
    sigma_m = expected_errors(mesh)
    weight = area if sigma_m is None else face_weight(area, sigma_m[good])
    surface = LevelSurface(first, middle @ first.T, normal @ first.T, area, weight)
    return turned_about_up(surface, heading(surface.normal[walls, :2], area[walls]))


def _calm(middle: np.ndarray, cross: np.ndarray) -> np.ndarray:
    """(F, 3) unit: the mean normal of the faces around that look the same way; of a face alone its own.

    Small faces of a rough mesh lean anywhere: of a wall that is uneven by a centimetre, a fifth would look upright.

    Args:
        middle: (F, 3) metres.
        cross: (F, 3) normals with a length that grows with the area.
    """
    side = np.abs(cross).argmax(axis=1)
    side = 2 * side + (cross[np.arange(len(cross)), side] > 0)
    cell = cell_indices(middle, CELL_M)
    cell -= cell.min(axis=0, initial=0)
    keys = np.ravel_multi_index((*cell.T, side), (*(cell.max(axis=0, initial=0) + 1), 6))
    group = np.unique(keys, return_inverse=True)[1]
    total = np.stack([np.bincount(group, part) for part in cross.T], axis=1)
    return (total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30))[group]


def turned_about_up(surface: LevelSurface, angle: float) -> LevelSurface:
    """The surface in a level frame whose x axis lies where `angle` (radians) points in this one."""
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    return replace(
        surface,
        level_from_world=turn @ surface.level_from_world,
        middle=surface.middle @ turn.T,
        normal=surface.normal @ turn.T,
    )


def heading(normals: np.ndarray, weight: np.ndarray) -> float:
    """Angle (radians, -45 to 45 degrees) along which or across which most of the normals (N, 2) point."""
    if not len(normals):
        return 0.0
    angle = np.degrees(np.arctan2(normals[:, 1], normals[:, 0])) % 90.0
    count = np.bincount((angle / BIN_DEG).astype(int) % int(90 / BIN_DEG), weight, int(90 / BIN_DEG))
    smooth = sum(np.roll(count, shift) for shift in range(-2, 3))
    mode = (float(np.argmax(smooth)) + 0.5) * BIN_DEG
    for window in (WINDOW_DEG, WINDOW_DEG / 2, WINDOW_DEG / 4):
        off = (angle - mode + 45.0) % 90.0 - 45.0
        near = np.abs(off) < window
        mode += float(np.average(off[near], weights=weight[near])) if near.any() else 0.0
    return float(np.radians((mode + 45.0) % 90.0 - 45.0))
