"""Manhattan axes of a room: up, and two horizontal directions if its walls stand at right angles."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from room2dgs.depth.joint.overlap import Overlap
from room2dgs.depth.joint.residuals import optimised_points

NARROWING = (0.87, 0.966, 0.9945)  # cosines of 30, 15 and 6 degrees
MIN_SHARE = 0.02  # of all normals that face up or down
UPRIGHT_SINE = 0.17  # surfaces that lean less than 10 degrees are walls
BINS = 90  # of a right angle
WINDOW_DEG = 8.0
# Of all walls, so many face one of two perpendicular directions: by chance 16 of 90 degrees' worth would.
MIN_MANHATTAN_SHARE = 0.45
STEP = 4  # samples between the points that a normal is computed from
JUMP = 0.25  # relative: a floor seen at a slant falls off fast, and what is no surface does not form a mode


def room_axes(views: Overlap, grid: Tensor) -> Tensor | None:
    """Modes of the surface normals of the optimised maps.

    Up is searched near the cameras' own (people hold cameras upright, more or less).

    Returns:
        (1 or 3, 3) unit, perpendicular, world frame, up first; None where too little of the room faces up or down.
    """
    normals = _normals(views, grid)
    up = -views.cameras.rotation[:, 1].mean(dim=0)
    for cosine in NARROWING:
        if not up.norm() > 1e-6:
            return None
        up = up / up.norm()
        along = normals @ up
        near = along.abs() > cosine
        if near.sum() < MIN_SHARE * len(normals) or not near.any():
            return None
        up = (normals[near] * along[near].sign()[:, None]).mean(dim=0)
    up = up / up.norm()
    across = _across(normals[(normals @ up).abs() < UPRIGHT_SINE], up)
    return up[None] if across is None else torch.stack([up, across, torch.linalg.cross(up, across)])


def _across(walls: Tensor, up: Tensor) -> Tensor | None:
    """The direction that most walls face, up to quarter turns; None if they face anywhere."""
    if not len(walls):
        return None
    first = torch.linalg.cross(up, torch.eye(3, dtype=up.dtype)[int(up.abs().argmin())])
    first = first / first.norm()
    second = torch.linalg.cross(up, first)
    quarter = math.pi / 2
    angle = torch.atan2(walls @ second, walls @ first) % quarter
    counts = torch.bincount((angle / quarter * BINS).long().clamp(max=BINS - 1), minlength=BINS).float()
    smooth = sum((counts.roll(shift) for shift in (-2, -1, 0, 1, 2)), start=torch.zeros_like(counts))
    mode = (float(smooth.argmax()) + 0.5) / BINS * quarter
    for window in (WINDOW_DEG, WINDOW_DEG / 2):
        off = (angle - mode + quarter / 2) % quarter - quarter / 2
        near = off.abs() < math.radians(window)
        if near.float().mean() < MIN_MANHATTAN_SHARE * window / WINDOW_DEG:
            return None
        mode += float(off[near].mean())
    return math.cos(mode) * first + math.sin(mode) * second


def _normals(views: Overlap, grid: Tensor) -> Tensor:
    """(N, 3) unit normals of the optimised maps, world frame, where the surface goes on to the right and below."""
    height, width = views.depth.shape[1:]
    row, column = (torch.arange(0, size - STEP, STEP) for size in (height, width))
    view, row, column = (
        part.flatten() for part in torch.meshgrid(torch.arange(len(views)), row, column, indexing="ij")
    )
    depth = torch.stack([views.depth[view, row + i, column + j] for i, j in ((0, 0), (0, STEP), (STEP, 0))])
    good = (depth.amin(dim=0) > 0) & (depth.amax(dim=0) < (1 + JUMP) * depth.amin(dim=0))
    view, row, column = view[good], row[good], column[good]
    first, right, below = (
        optimised_points(views, grid, view, row + i, column + j) for i, j in ((0, 0), (0, STEP), (STEP, 0))
    )
    normal = torch.linalg.cross(below - first, right - first)
    normal = normal / normal.norm(dim=1, keepdim=True).clamp(min=1e-12)
    return torch.einsum("nji,nj->ni", views.cameras.rotation[view], normal)
