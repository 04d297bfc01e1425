"""The surfels of a page: those that cover most, each a disc that looks into the room."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.spatial import cKDTree

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.rotations import normals
from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.primitives.registry import primitive_of
from room2dgs.runs.page.packing import packed, stepped

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats
    from room2dgs.runs.page.mesh_layer import PageMesh

Inward = Callable[[np.ndarray], np.ndarray]  # places (N, 3) to directions (N, 3) of any length, into the room


def as_mesh_faces(room: PageMesh) -> Inward:
    """As the nearest vertex's normal."""
    tree = cKDTree(room.vertices)
    return lambda places: room.normals[tree.query(places)[1]]


def to_nearest(cameras: Sequence[Camera]) -> Inward:
    """Towards the nearest camera."""
    centres = np.array([camera.centre for camera in cameras])
    tree = cKDTree(centres)
    return lambda places: centres[tree.query(places)[1]] - places


def block(splats: Splats, most: int, inward: Inward) -> tuple[dict, str]:
    """What room.js wants to know of the discs, and their bytes.

    Colours are those that do not depend on the direction (harmonics of degree 0). Discs are turned over to face into
    the room: from outside one looks through the backs of walls, as with the mesh.

    Args:
        most: no more discs; those with the largest area times opacity stay.
    """
    discs = primitive_of(splats).as_discs(splats)
    centers, quaternions, scales, opacities = (np.asarray(part.detach().numpy(), np.float64) for part in discs[:4])
    kept = np.sort(np.argsort(-scales.prod(axis=1) * opacities, kind="stable")[:most])
    centers, quaternions, scales, opacities = (part[kept] for part in (centers, quaternions, scales, opacities))
    quaternions = quaternions / np.maximum(np.linalg.norm(quaternions, axis=1, keepdims=True), 1e-12)
    if len(centers):
        back = (normals(torch.from_numpy(quaternions)).numpy() * inward(centers)).sum(axis=1) < 0
        quaternions = np.where(back[:, None], turned_over(quaternions), quaternions)
    rgb = np.clip(0.5 + C0 * discs.sh.detach().numpy()[kept, 0], 0, 1)
    color = np.round(np.concatenate([rgb, opacities[:, None]], axis=1) * 255).astype(np.uint8)
    positions, low, step = stepped(centers)
    about = {"count": len(centers), "low": low.tolist(), "step": step}
    turned = np.round(quaternions * 32767).astype(np.int16)
    return about, packed(positions, scales.astype(np.float32), turned, color)


def turned_over(quaternions: np.ndarray) -> np.ndarray:
    """(N, 4) w x y z, half a turn about each disc's own first axis: the same disc, its normal the other way."""
    w, x, y, z = quaternions.T
    return np.stack([-x, w, z, -y], axis=1)
