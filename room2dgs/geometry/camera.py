"""A pinhole camera with a pose: projection, its inverse, and rays.

`camera_tensors` has the same for many cameras at once, in torch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from room2dgs.geometry.poses import inverse_pose

NEAR_M = 0.05  # a point nearer to the camera's plane is not in its image


@dataclass(frozen=True)
class Camera:
    """A pinhole camera in the house's conventions.

    Axes are OpenCV's (x right, y down, z forward). Pixel (i, j) has its centre at (i + 0.5, j + 0.5). Depth is
    z-depth, not ray length.

    Attributes:
        K: (3, 3) float64, pixels; skew is zero.
        width, height: image size in pixels.
        cam_from_world: (4, 4) float64, rigid, metres.
    """

    K: np.ndarray
    width: int
    height: int
    cam_from_world: np.ndarray

    @property
    def world_from_cam(self) -> np.ndarray:
        """(4, 4) float64, the inverse pose (camera-to-world)."""
        return inverse_pose(self.cam_from_world)

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) float64 of cam_from_world; its rows are the camera's axes in the world."""
        return self.cam_from_world[:3, :3]

    @property
    def centre(self) -> np.ndarray:
        """(3,) float64, the projection centre in the world, metres."""
        return self.world_from_cam[:3, 3]

    @property
    def forward(self) -> np.ndarray:
        """(3,) float64, the optical axis in the world."""
        return self.cam_from_world[2, :3].copy()

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.width, self.height

    def resized(self, width: int, height: int) -> Camera:
        """The same view at another image size; focal lengths and cx, cy are scaled alike.

        With pixel centres at +0.5 a resize is a plain scaling of K's first two rows.
        """
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return replace(self, K=scale @ self.K, width=width, height=height)

    def resized_to_width(self, width: int) -> Camera:
        """The same view at another width, in the same shape as far as whole pixels allow."""
        return self.resized(width, max(1, round(self.height * width / self.width)))

    def zoomed(self, factor: float) -> Camera:
        """With focal lengths `factor` times as long."""
        return replace(self, K=self.K * [[factor, 1, 1], [1, factor, 1], [1, 1, 1]])

    def to_camera(self, xyz: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the world, metres, in the camera frame."""
        return xyz @ self.rotation.T + self.cam_from_world[:3, 3]

    def to_world(self, in_cam: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the camera frame, metres, in the world."""
        return (in_cam - self.cam_from_world[:3, 3]) @ self.rotation

    def turned_to_camera(self, vectors: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the world, such as normals, in the camera frame."""
        return vectors @ self.rotation.T

    def turned_to_world(self, vectors: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the camera frame, such as rays and normals, in the world."""
        return vectors @ self.rotation

    def project(self, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the camera sees points of the world.

        Args:
            xyz: (..., 3) metres.

        Returns:
            (..., 2) float64 pixels (x, y), NaN for points that are not in front of the camera's plane, and (...)
            float64 z-depth, metres.
        """
        in_cam = self.to_camera(np.asarray(xyz, dtype=np.float64))
        depth = in_cam[..., 2]
        divisor = np.where(depth > 0, depth, np.nan)
        return in_cam[..., :2] / divisor[..., None] * self.K[(0, 1), (0, 1)] + self.K[:2, 2], depth

    def unproject(self, pixel: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """The way back from `project`.

        Args:
            pixel: (..., 2).
            depth: (...) z-depth, metres.

        Returns:
            (..., 3) float64 metres, world frame.
        """
        return self.to_world(self.rays_at(pixel) * np.asarray(depth)[..., None])

    def unproject_map(self, depth: np.ndarray) -> np.ndarray:
        """Points of a depth map (H, W) of the camera's size, at the pixels' centres.

        Returns:
            (H, W, 3) float64 metres, world frame; where the depth is 0, the camera's centre.
        """
        return self.to_world(self.rays() * depth[..., None])

    def pixels(self) -> np.ndarray:
        """(H, W, 2) float64 centres (x, y) of the pixels."""
        return np.stack(np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5), axis=-1)

    def rays(self) -> np.ndarray:
        """(H, W, 3) float64 directions through the pixels' centres, camera frame, z = 1: ray length is z-depth."""
        return self.rays_at(self.pixels())

    def rays_at(self, pixel: np.ndarray) -> np.ndarray:
        """(..., 3) float64 directions through pixels (..., 2), camera frame, z = 1."""
        across = (np.asarray(pixel, dtype=np.float64) - self.K[:2, 2]) / self.K[(0, 1), (0, 1)]
        return np.concatenate([across, np.ones((*across.shape[:-1], 1))], axis=-1)

    def world_rays(self) -> np.ndarray:
        """(H, W, 3) float64 directions through the pixels' centres, world frame; ray length is z-depth."""
        return self.turned_to_world(self.rays())

    def inside(self, pixel: np.ndarray) -> np.ndarray:
        """(...) bool: pixels (..., 2) within the image, the left and upper border included; NaN is not."""
        pixel = np.asarray(pixel)
        return np.asarray(((pixel >= 0) & (pixel < (self.width, self.height))).all(axis=-1))

    def in_view(self, xyz: np.ndarray, near_m: float = NEAR_M) -> np.ndarray:
        """(...) bool: points (..., 3) of the world inside the image and at least `near_m` in front, hidden or not."""
        pixel, depth = self.project(xyz)
        return self.inside(pixel) & (depth >= near_m)

    def pixels_of(
        self, xyz: np.ndarray, near_m: float = NEAR_M
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Which points (N, 3) of the world are in the image and more than `near_m` in front, hidden or not.

        Returns:
            (M,) int64 each: their numbers, and the columns and rows of the pixels that they fall into; (M,) float64
            z-depth, metres.
        """
        pixel, depth = self.project(xyz)
        number = np.flatnonzero(self.inside(pixel) & (depth > near_m))
        column, row = np.floor(pixel[number]).astype(np.int64).T
        return number, column, row, depth[number]
