"""Cameras as tensors: what `camera` does for one camera in numpy, for many at once in torch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.geometry.camera import Camera

MIN_DEPTH_M = 1e-3  # what is divided by at least: points behind a camera get no pixel worth reading


def view_matrices(camera: Camera) -> tuple[Tensor, Tensor]:
    """K (3, 3) in pixels and cam_from_world (4, 4), both float32, as the rasterizer and the losses take them."""
    return torch.from_numpy(camera.K.astype(np.float32)), torch.from_numpy(camera.cam_from_world.astype(np.float32))


class CameraTensors(NamedTuple):
    """V pinhole cameras; float32. A `view` below is an (N,) int64 index among them.

    Attributes:
        size: (V, 2) width and height, pixels.
        focal, principal: (V, 2) pixels; centres at +0.5.
        rotation, translation: (V, 3, 3), (V, 3) of cam_from_world, metres.
    """

    size: Tensor
    focal: Tensor
    principal: Tensor
    rotation: Tensor
    translation: Tensor

    def rays(self, view: Tensor, pixel: Tensor) -> Tensor:
        """(N, 3) directions through pixels (N, 2), camera frame, z = 1."""
        across = (pixel - self.principal[view]) / self.focal[view]
        return torch.cat([across, torch.ones_like(across[:, :1])], dim=1)

    def project(self, view: Tensor, in_cam: Tensor) -> tuple[Tensor, Tensor]:
        """Pixels (N, 2) of points (N, 3) of the camera frame, and z-depth (N,), metres.

        A depth of 0 or less is behind the camera: its pixel means nothing.
        """
        z = in_cam[:, 2]
        return in_cam[:, :2] / z.clamp(min=MIN_DEPTH_M)[:, None] * self.focal[view] + self.principal[view], z

    def seen_by(self, other: Tensor, view: Tensor, in_cam: Tensor) -> tuple[Tensor, Tensor]:
        """Points (N, 3) of one view's camera frame as another view sees them; pixels and depths as `project`."""
        in_world = torch.einsum("nji,nj->ni", self.rotation[view], in_cam - self.translation[view])
        return self.project(other, torch.einsum("nij,nj->ni", self.rotation[other], in_world) + self.translation[other])

    def inside(self, view: Tensor, pixel: Tensor) -> Tensor:
        """(N,) bool: pixels (N, 2) within the image."""
        return (pixel > 0).all(dim=1) & (pixel < self.size[view]).all(dim=1)


def camera_tensors(cameras: Sequence[Camera]) -> CameraTensors:
    """The cameras, in their order."""
    K = np.stack([camera.K for camera in cameras])
    pose = np.stack([camera.cam_from_world for camera in cameras])
    size = np.array([camera.size for camera in cameras])
    parts = (size, K[:, (0, 1), (0, 1)], K[:, :2, 2], pose[:, :3, :3], pose[:, :3, 3])
    return CameraTensors(*(torch.from_numpy(np.ascontiguousarray(part, dtype=np.float32)) for part in parts))
