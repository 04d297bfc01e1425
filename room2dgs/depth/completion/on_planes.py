"""Which pixels of a view show one of the room's planes, and how far away that is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from room2dgs.depth.completion.expected_error import LEAST_ERROR
from room2dgs.depth.completion.low_res import Completed, LowResInput, rescaled
from room2dgs.depth.completion.planes import Plane
from room2dgs.geometry.camera import Camera

NEAR = 0.1  # relative difference between a pixel's depth and a plane's at which the pixel starts to count as off it
FLAT = 0.02  # likewise of a completed depth that is to lie on the plane in the end
FROM_PLANE = 2.0  # expected errors between a depth and a plane at which it goes half of the way
TURNED = (0.85, 0.95)  # cosine between the normals of pixel and plane: from none of the weight to all of it


class OnPlanes(NamedTuple):
    """What one view's pixels show of the planes.

    Attributes:
        depth: (h, w) metres, of the plane; 0 = none.
        weight: (h, w) 0..1, by how probably it is this one.
        which: (h, w) int, its place among the planes; -1 = none.
    """

    depth: np.ndarray
    weight: np.ndarray
    which: np.ndarray


def on_planes(
    depth: np.ndarray, normal: np.ndarray, camera: Camera, planes: Sequence[Plane], near: float = NEAR
) -> OnPlanes:
    """The plane that each pixel most probably shows.

    Args:
        depth: (h, w) metres, 0 = invalid.
        normal: (h, w, 3) unit, world frame, towards the camera; 0 = invalid.
        near: relative difference that halves the weight.
    """
    found, weight, which = np.zeros(depth.shape), np.zeros(depth.shape), np.full(depth.shape, -1)
    rays, centre = camera.rays() @ camera.rotation, camera.centre
    for index, plane in enumerate(planes):
        facing = rays @ plane.normal
        to_plane = plane.offset - centre @ plane.normal
        z = np.divide(to_plane, facing, out=np.zeros(depth.shape), where=facing < -1e-3)
        seen = (z > 0) & (depth > 0)
        off = np.log(np.where(seen, z, 1) / np.where(seen, depth, 1)) / near
        turned = np.clip((normal @ plane.normal - TURNED[0]) / (TURNED[1] - TURNED[0]), 0, 1)
        mine = np.where(seen & (np.abs(off) < 2), turned / (1 + off**2), 0)
        better = mine > weight
        found[better], weight[better], which[better] = z[better], mine[better], index
    return OnPlanes(found, weight, which)


def flattened_view(given: LowResInput, view: Completed, planes: Sequence[Plane]) -> Completed:
    """A view's depth, what almost lies on a plane on it."""
    log_factor, share = flattened(view.depth, given.normal, given.camera, planes)
    return rescaled(view, log_factor)._replace(flat=share.astype(np.float32))


def flattened(
    depth: np.ndarray, normal: np.ndarray, camera: Camera, planes: Sequence[Plane], error: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """How far each pixel has to go to a plane that it almost lies on.

    A solution between samples and slopes follows the samples' noise; a wall is flat.

    Args:
        depth, normal, camera, planes: as `on_planes`.
        error: (h, w) relative error to be expected of the depth, where a plane that is many of them away is none of
            its; None: any plane counts.

    Returns:
        (h, w) to add to ln(depth), and (h, w) the share 0..1 of the way to the plane that this is.
    """
    on, share, _ = on_planes(depth, normal, camera, planes, FLAT)
    known = share > 0
    away = np.log(np.where(known, on, 1) / np.where(known, depth, 1))
    if error is not None:
        share = share / (1 + (away / (FROM_PLANE * np.maximum(error, LEAST_ERROR))) ** 2)
    return share * away, share
