"""How a plane, and a point, carry the pixels of one view to another."""

from __future__ import annotations

import torch
from kornia.geometry.camera import project_points, unproject_points
from kornia.geometry.epipolar import relative_camera_motion
from torch import Tensor

MIN_FACING = 0.05  # |n . ray| of planes seen more edge-on
MIN_DISTANCE_M = 1e-3  # of a plane from the camera
MIN_WEIGHT = 1e-3  # of a warped point: depth over depth in the reference view


def relative_pose(reference_from_world: Tensor, neighbour_from_world: Tensor) -> Tensor:
    """neighbour_from_reference (4, 4) of two rigid poses (4, 4)."""
    a, b = reference_from_world, neighbour_from_world
    pose = torch.eye(4, dtype=a.dtype, device=a.device)
    pose[:3, :3], pose[:3, 3:] = relative_camera_motion(a[:3, :3], a[:3, 3:], b[:3, :3], b[:3, 3:])
    return pose


def plane_distance(normal: Tensor, ray: Tensor, depth: Tensor) -> Tensor:
    """d of the plane n . X = d through X = ray * depth: the camera's distance along n, which is not the z-depth.

    |n . ray| counts as 0.05 at least and |d| as 1 mm; below there is no gradient.

    Args:
        normal: (M, 3) unit, in the camera; either side.
        ray: (M, 3) in the camera, z = 1.
        depth: (M,) z-depth, metres.

    Returns:
        (M,) metres; negative for normals that face the camera.
    """
    facing = (normal * ray).sum(-1)
    side = 1.0 - 2.0 * (facing.detach() <= 0).to(facing.dtype)
    return side * ((side * facing).clamp_min(MIN_FACING) * depth).clamp_min(MIN_DISTANCE_M)


def plane_homography(
    normal: Tensor, distance: Tensor, neighbour_from_reference: Tensor, K_reference: Tensor, K_neighbour: Tensor
) -> Tensor:
    """H = K_n (R + T n^T / d) K_r^-1, which maps the pixels of the plane n . X = d (eq. 13).

    X_n = R X + T, with X and the plane in the reference camera. The paper's minus belongs to planes n . X + d = 0.

    Args:
        normal: (M, 3).
        distance: (M,) not 0; see `plane_distance`.
        neighbour_from_reference: (4, 4) rigid: R and T.
        K_reference, K_neighbour: (3, 3) pixels.

    Returns:
        (M, 3, 3), up to scale, for pixels (x, y, 1) with centres at +0.5. The third coordinate of a mapped pixel of
        the plane is its depth in the neighbour over its depth in the reference.
    """
    rotation, translation = neighbour_from_reference[:3, :3], neighbour_from_reference[:3, 3]
    back = torch.linalg.inv(K_reference)
    of_infinity = K_neighbour @ rotation @ back
    return of_infinity + (K_neighbour @ translation)[:, None] * ((normal / distance[:, None]) @ back)[:, None, :]


def warp_points(homography: Tensor, pixels: Tensor, offsets: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Map the points pixels + offsets around each pixel by its own homography.

    What kornia's `transform_points` gives for them, in a third of its time.

    Args:
        homography: (M, 3, 3).
        pixels: (M, 2).
        offsets: (P, 2) pixels.

    Returns:
        x, y (M, P) pixels, and the third coordinate (M, P): not positive for points that are not before both cameras,
        whose pixels mean nothing.
    """
    linear = homography[:, :, :2]
    middle = linear @ pixels[:, :, None] + homography[:, :, 2:]
    x, y, weight = (linear @ offsets.T + middle).unbind(1)
    inverse = weight.clamp_min(MIN_WEIGHT).reciprocal()
    return x * inverse, y * inverse, weight


def transfer(pixels: Tensor, depth: Tensor, b_from_a: Tensor, K_a: Tensor, K_b: Tensor) -> tuple[Tensor, Tensor]:
    """Where view b sees what view a sees at `pixels`.

    Args:
        pixels: (M, 2).
        depth: (M,) z-depth in a, metres.
        b_from_a: (4, 4) rigid.
        K_a, K_b: (3, 3) pixels.

    Returns:
        (M, 2) pixels and (M,) z-depth in b; where that is not positive, the pixels mean nothing.
    """
    points = torch.addmm(b_from_a[:3, 3], unproject_points(pixels, depth[:, None], K_a), b_from_a[:3, :3].T)
    return project_points(points, K_b), points[:, 2]
