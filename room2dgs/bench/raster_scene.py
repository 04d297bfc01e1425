"""The room that the raster benchmark draws: surfels on the walls of a box, seen from inside."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from room2dgs.geometry.poses import pose_at
from room2dgs.geometry.rotations import quaternions_to
from room2dgs.splat import Surfels

ROOM_M = (5.0, 4.0, 2.6)


def box_surfels(count: int, seed: int = 0) -> Surfels:
    """Surfels spread evenly over a box's six faces, with the sizes and opacities that training ends with.

    Scales follow the spacing, with log-normal spread; normals are within about 6 degrees of the wall's.
    """
    g = np.random.default_rng(seed)
    size = np.array(ROOM_M)
    areas = np.repeat([size[1] * size[2], size[0] * size[2], size[0] * size[1]], 2)
    face = g.choice(6, count, p=areas / areas.sum())
    axis = face // 2
    centers = g.random((count, 3)) * size
    centers[np.arange(count), axis] = np.where(face % 2 == 0, 0.0, size[axis])
    centers += g.normal(0, 0.005, centers.shape)
    normals = g.normal(0, 0.1, (count, 3))
    normals[np.arange(count), axis] += 1.0
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rotations = quaternions_to(normals)
    scales = np.sqrt(areas.sum() / count) * np.exp(g.normal(0, 0.3, (count, 2)))
    opacities = 1 / (1 + np.exp(-g.normal(1.0, 1.5, count)))
    sh = g.normal(0, 0.3, (count, 1, 3))
    return Surfels(*(torch.tensor(x, dtype=torch.float32) for x in (centers, rotations, scales, opacities, sh)))


def inside_view(width: int, height: int) -> tuple[Tensor, Tensor]:
    """(K, cam_from_world) of a camera that stands in the box and looks into a corner; 62 degrees wide."""
    forward = np.array([0.8, 0.5, -0.1])
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    cam_from_world = pose_at(rotation, np.array([1.0, 1.0, 1.5]))
    focal = 0.83 * width
    K = torch.tensor([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], dtype=torch.float32)
    return K, torch.tensor(cam_from_world, dtype=torch.float32)
