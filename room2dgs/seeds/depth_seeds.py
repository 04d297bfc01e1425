"""Seeds where structure from motion is blind: the depth prior's surface.

Blank walls have no sparse points and growth cannot reach them. The aligned depth maps cover them. A pixel weighs the
more the smaller its expected error is, and few other views may see a surface behind it. What only one view sees gets
seeds, too: without them the surfels in front of it grow over it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree

from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.depth.joint.overlap import Overlap, overlap
from room2dgs.geometry.depth_maps import depth_normals
from room2dgs.seeds.voxelise import cell_centres, cell_keys

MAX_RELATIVE_DIFFERENCE = 0.03  # relative difference of depth within which two views see the same surface
MIN_NUM_CONSISTENT = 2  # other views, where nobody knows the pixel's expected error
UNKNOWN = 0.4  # weight of such a pixel
# Occlusion violations: of the other views with a depth there, this share may have a surface behind the point.
MAX_VIOLATIONS = 0.34
MIN_WEIGHT = 2.0  # of a cell's pixels, over all views; with less it is noise
# Means of neighbouring cells nearer than this share of a cell are one piece of surface, cut by the cells' border.
MIN_SEPARATION = 0.5
NORMAL_STEP = 4  # pixels to either side


class Surface(NamedTuple):
    """Pieces of surface, one a cell.

    Attributes:
        cells: (S, 3) centres of the cells, metres.
        xyz: (S, 3) weighted mean of what the views saw in the cell, metres.
        normals: (S, 3) unit, towards the cameras that saw it.
        rgb: (S, 3) 0..1.
    """

    cells: np.ndarray
    xyz: np.ndarray
    normals: np.ndarray
    rgb: np.ndarray


def prior_surface(frames: Sequence[Frame], priors: Mapping[str, ViewMaps], voxel_m: float) -> Surface:
    """Fuse the depth priors into cells; the same input gives the same bits.

    Args:
        frames: training views; those without a depth prior are passed over.
        priors: by frame name; depth in metres, aligned; confidence as that of `completion.expected_error`, if known.
        voxel_m: edge of a cell.

    Returns:
        Pieces in rising order of their cells' keys; none if no views overlap.

    Raises:
        InputError: depths so large that their cells cannot be counted.
    """
    frames = [frame for frame in frames if frame.name in priors and priors[frame.name].depth is not None]
    if not frames:
        return Surface(*np.zeros((4, 0, 3)))
    depths: LazyMaps[np.ndarray] = LazyMaps()
    for frame in frames:
        depths.add(frame.name, partial(_depth, priors, frame.name))
    views = overlap(frames, depths, {})
    parts = [_unoccluded_pixels(views, index, frame, priors[frame.name]) for index, frame in enumerate(frames)]
    xyz, normals, rgb, weight = (np.concatenate(values) for values in zip(*parts, strict=True))
    return _in_cells(xyz, normals, rgb, weight, voxel_m)


def away_from(surface: Surface, xyz: np.ndarray, voxel_m: float) -> Surface:
    """The pieces whose cell holds none of the points `xyz` (M, 3)."""
    occupied = np.unique(cell_keys(xyz, voxel_m))
    free = ~np.isin(cell_keys(surface.cells, voxel_m), occupied)
    return Surface(*(values[free] for values in surface))


def _depth(priors: Mapping[str, ViewMaps[np.ndarray]], name: str) -> np.ndarray:
    depth = priors[name].depth
    assert depth is not None  # only frames that have one are asked for
    return depth


def _unoccluded_pixels(
    views: Overlap, index: int, frame: Frame, maps: ViewMaps[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """World points, normals, colours and weights of the pixels of one view that few other views see through."""
    grid = (slice(views.step // 2, None, views.step),) * 2
    depth = maps.depth
    assert depth is not None
    normal = depth_normals(depth, frame.camera, NORMAL_STEP)[grid]
    usable = (depth[grid] > 0) & normal.any(axis=-1)
    mask = frame.mask()
    row, column = map(torch.from_numpy, np.nonzero(usable if mask is None else usable & mask[grid]))
    view = torch.full_like(row, index)
    in_cam = views.cameras.rays(view, views.pixel(row, column)) * views.depth[view, row, column][:, None]
    consistent, covering, violating = (torch.zeros(len(row), dtype=torch.float32) for _ in range(3))
    for beside in views.pairs[views.pairs[:, 0] == index, 1]:
        other = torch.full_like(row, int(beside))
        pixel, z = views.cameras.seen_by(other, view, in_cam)
        inside = (z > 0.05) & views.cameras.inside(other, pixel)
        known, good = views.depth_at(other, pixel)
        good &= inside
        ratio = z / known.clamp(min=1e-6)
        covering += good
        consistent += good & ((ratio - 1).abs() < MAX_RELATIVE_DIFFERENCE)
        violating += good & (ratio < 1 - MAX_RELATIVE_DIFFERENCE)
    accepted = (violating <= MAX_VIOLATIONS * covering).numpy()
    if maps.depth_confidence is None:
        weight = np.where(consistent.numpy() >= MIN_NUM_CONSISTENT, UNKNOWN, 0.0)
    else:  # about the inverse of the expected error
        weight = np.sqrt(maps.depth_confidence[grid][row.numpy(), column.numpy()].astype(np.float64))
    accepted &= weight > 0
    camera = frame.camera
    xyz = camera.to_world(in_cam.numpy()[accepted])
    picked = (row.numpy()[accepted], column.numpy()[accepted])
    return xyz, camera.turned_to_world(normal[picked]), frame.levelled_color()[grid][picked] / 255.0, weight[accepted]


def _in_cells(xyz: np.ndarray, normals: np.ndarray, rgb: np.ndarray, weight: np.ndarray, voxel_m: float) -> Surface:
    keys, cell = np.unique(cell_keys(xyz, voxel_m), return_inverse=True)
    cell = cell.reshape(-1)
    total = np.bincount(cell, weight, len(keys))

    def mean(values: np.ndarray) -> np.ndarray:
        sums = [np.bincount(cell, weight * values[:, axis], len(keys)) for axis in range(3)]
        return np.stack(sums, axis=1) / total[:, None]

    position, normal, color = mean(xyz), mean(normals), mean(rgb)
    length = np.linalg.norm(normal, axis=1)
    # normals that cancel are no surface; a slanted one is cut by cells into slivers, of which the fuller stays
    # the sum of five weights of 0.4 is not 2 to the last bit
    good = (total >= MIN_WEIGHT - 1e-6) & (length > 0.5)
    good &= ~suppressed(position, np.where(good, total, 0), MIN_SEPARATION * voxel_m)
    return Surface(cell_centres(keys, voxel_m)[good], position[good], normal[good] / length[good, None], color[good])


def suppressed(position: np.ndarray, weight: np.ndarray, radius_m: float) -> np.ndarray:
    """(S,) bool: has a neighbour within the radius with more weight (as much and a lower index) that stays."""
    out = weight == 0
    neighbours = cKDTree(position).query_ball_point(position, radius_m) if len(position) else []
    for index in np.lexsort((np.arange(len(position)), -weight)):
        if not out[index]:
            for other in neighbours[index]:
                out[other] |= other != index
    return out
