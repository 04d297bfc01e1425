"""Depth, poses, intrinsics, colours and mesh of a made room agree with one another to the millimetre."""

from __future__ import annotations

import cv2
import numpy as np
import open3d as o3d
import pytest
import trimesh
from scipy.ndimage import map_coordinates


def bilinear(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Values at pixel coordinates with centres at +0.5."""
    channels = image.reshape(*image.shape[:2], -1)
    return np.stack(
        [map_coordinates(c, [y - 0.5, x - 0.5], order=1, mode="nearest") for c in np.moveaxis(channels, 2, 0)],
        -1,
    )


def seen_in(capture, first: int, second: int):
    """Pixels of frame `first` projected into `second`: rows, x, y and depth error, where smooth."""
    mask = capture.depths[first] > 0
    offset = capture.points(first)[mask] - capture.poses[second][:3, 3]
    in_cam = offset @ capture.poses[second][:3, :3]
    z = in_cam[:, 2]
    safe = np.where(z > 0.1, z, 1.0)
    x = capture.K[0, 0] * in_cam[:, 0] / safe + capture.K[0, 2]
    y = capture.K[1, 1] * in_cam[:, 1] / safe + capture.K[1, 2]
    depth = capture.depths[second]
    height, width = depth.shape
    inside = (z > 0.1) & (x > 2) & (x < width - 2) & (y > 2) & (y < height - 2)
    inverse = np.where(depth > 0, 1 / np.maximum(depth, 1e-3), 1e3).astype(np.float32)
    # on a plane inverse depth is linear in the pixel: its Laplacian is only the rounding to millimetres
    bend = np.abs(cv2.Laplacian(inverse, cv2.CV_32F, ksize=1))
    flat = cv2.dilate((bend > 2e-3).astype(np.uint8), np.ones((5, 5), np.uint8)) == 0
    column, row = np.clip(x.astype(int), 0, width - 1), np.clip(y.astype(int), 0, height - 1)
    there = 1 / bilinear(inverse, x, y)[:, 0]
    keep = inside & flat[row, column] & (np.abs(there - z) < 0.03)
    rows = np.flatnonzero(mask)[keep]
    return rows, x[keep], y[keep], z[keep] - there[keep]


def test_depth_is_where_the_mesh_is(plain):
    mesh = trimesh.load(plain.path / "gt_mesh.ply", process=False)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(np.asarray(mesh.vertices, np.float32)),
        o3d.core.Tensor(np.asarray(mesh.faces, np.uint32)),
    )
    for pose, depth in zip(plain.poses, plain.depths, strict=True):
        directions = plain.rays() @ pose[:3, :3].T
        rays = np.concatenate([np.broadcast_to(pose[:3, 3], directions.shape), directions], -1)
        hit = scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))["t_hit"].numpy()
        solid = depth > 0
        # triangles that are mostly hidden are not in the mesh, so a few pixels at silhouettes pass through
        assert np.mean(np.abs(hit[solid] - depth[solid]) < 6e-4) > 0.97
        assert np.mean(hit[solid] < depth[solid] - 6e-4) < 1e-3


def test_lights_have_no_depth_no_surface_and_are_overexposed(plain):
    mesh = trimesh.load(plain.path / "gt_mesh.ply", process=False)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(np.asarray(mesh.vertices, np.float32)),
        o3d.core.Tensor(np.asarray(mesh.faces, np.uint32)),
    )
    count = 0
    for pose, depth, color in zip(plain.poses, plain.depths, plain.colors, strict=True):
        dark = depth == 0
        inner = cv2.erode(dark.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        # JPEG rings beside the frame
        assert np.all(color[inner] > 235)
        assert not inner.any() or np.mean(color[inner]) > 252
        directions = plain.rays()[inner] @ pose[:3, :3].T
        rays = np.concatenate([np.broadcast_to(pose[:3, 3], directions.shape), directions], -1)
        assert np.all(np.isinf(scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))["t_hit"].numpy()))
        count += inner.sum()
    assert count > 200


def test_depth_of_neighbouring_frames_agrees(plain):
    errors = np.concatenate([np.abs(seen_in(plain, i, i + 1)[3]) for i in range(len(plain.poses) - 1)])
    assert len(errors) > 5000
    # two roundings to millimetres give 0.3 mm; half a pixel in cx, cy would give 6 mm
    assert np.median(errors) < 4e-4
    assert np.quantile(errors, 0.99) < 1e-3


def test_colours_stick_to_the_surfaces(plain):
    """The photometric error between frames is least without a shift: no swim, no half pixel."""
    shifts = [(dx, dy) for dx in (-0.5, 0.0, 0.5) for dy in (-0.5, 0.0, 0.5)]
    squares = np.zeros(len(shifts))
    first, second = [], []
    for i in range(len(plain.poses) - 1):
        rows, x, y, _ = seen_in(plain, i, i + 1)
        here = plain.colors[i].reshape(-1, 3)[rows]
        for k, (dx, dy) in enumerate(shifts):
            there = bilinear(plain.colors[i + 1], x + dx, y + dy)
            squares[k] += ((here - there) ** 2).sum()
        first.append(here)
        second.append(bilinear(plain.colors[i + 1], x, y))
    assert shifts[int(np.argmin(squares))] == (0.0, 0.0)
    assert np.corrcoef(np.concatenate(first).ravel(), np.concatenate(second).ravel())[0, 1] > 0.9


def test_intrinsics_count_pixel_centres_at_integers(plain):
    for name in ("color", "depth"):
        matrix = np.loadtxt(plain.path / f"intrinsic/intrinsic_{name}.txt")
        assert matrix.shape == (4, 4)
        focal = 48 / np.tan(np.radians(35))
        expected = np.eye(4)
        expected[0, 0] = expected[1, 1] = focal
        expected[0, 2], expected[1, 2] = 47.5, 35.5
        np.testing.assert_allclose(matrix, expected, atol=1e-8)


def test_poses_are_rigid_upright_and_in_the_room(plain):
    for pose in plain.poses:
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-8)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
        np.testing.assert_array_equal(pose[3], [0, 0, 0, 1])
        assert np.all(pose[:3, 3] > 0.35) and np.all(pose[:3, 3] < [4.15, 3.15, 2.25])
        assert pose[2, 1] < -0.7  # the camera's y axis points down


def test_mesh_is_small_triangles_of_the_room(plain):
    mesh = trimesh.load(plain.path / "gt_mesh.ply", process=False)
    assert mesh.edges_unique_length.max() <= 0.05
    assert np.all(mesh.vertices.min(0) > -1e-6) and np.all(mesh.vertices.max(0) < np.array([4.5, 3.5, 2.6]) + 1e-6)
    assert mesh.visual.vertex_colors[:, :3].std() > 20


def test_mesh_holds_only_what_was_seen(plain):
    centroids = trimesh.load(plain.path / "gt_mesh.ply", process=False).triangles_center
    seen = np.zeros(len(centroids), bool)
    height, width = plain.depths[0].shape
    for pose, depth in zip(plain.poses, plain.depths, strict=True):
        in_cam = (centroids - pose[:3, 3]) @ pose[:3, :3]
        z = np.where(in_cam[:, 2] > 0.1, in_cam[:, 2], np.inf)
        x = plain.K[0, 0] * in_cam[:, 0] / z + plain.K[0, 2]
        y = plain.K[1, 1] * in_cam[:, 1] / z + plain.K[1, 2]
        inside = np.isfinite(z) & (x > 0) & (x < width) & (y > 0) & (y < height)
        farthest = cv2.dilate(depth, np.ones((3, 3)))
        row, column = np.clip(y.astype(int), 0, height - 1), np.clip(x.astype(int), 0, width - 1)
        seen |= inside & (z < 1.02 * farthest[row, column])
    assert seen.mean() > 0.99
