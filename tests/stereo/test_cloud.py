"""The fused point cloud: one point a cell, the same bits, and a file that another library reads."""

from __future__ import annotations

import numpy as np
import trimesh

from room2dgs.stereo.cloud import fused_cloud, ply_bytes


def views(corner):
    for camera, photo, depth, normals in corner:
        color = np.stack([photo, 255 - photo, np.full_like(photo, 7)], axis=-1)
        yield camera, np.where(depth < 4, depth, 0), camera.turned_to_world(normals), color


def test_points_lie_on_the_surfaces_one_a_cell(corner):
    cloud = fused_cloud(views(corner), 0.02)
    assert 500 < len(cloud.xyz) < 20000
    wall = np.abs(cloud.xyz @ [-0.3, 0, 1.0] - 2.0) / np.linalg.norm([-0.3, 0, 1.0])
    floor = np.abs(cloud.xyz[:, 1] - 0.55)
    on = np.minimum(wall, floor)
    assert np.mean(on < 1e-6) > 0.97 and on.max() < 0.02  # a cell at the edge holds both
    assert len(np.unique(np.floor(cloud.xyz / 0.02), axis=0)) >= 0.97 * len(cloud.xyz)
    expected = np.where((wall < floor)[:, None], -np.array([-0.3, 0, 1.0]) / np.linalg.norm([0.3, 1]), [0, -1.0, 0])
    assert np.median((cloud.normal * expected).sum(axis=1)) > 0.9999


def test_order_of_memory_does_not_matter_and_nothing_gives_nothing(corner):
    one, other = fused_cloud(views(corner), 0.05), fused_cloud(views(corner), 0.05)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)
    camera = corner[0][0]
    empty = np.zeros((72, 96))
    nothing = fused_cloud([(camera, empty, np.zeros((72, 96, 3)), np.zeros((72, 96, 3), np.uint8))], 0.05)
    assert len(nothing.xyz) == 0 and ply_bytes(nothing).endswith(b"end_header\n")


def test_the_file_is_read_by_another_library(corner, tmp_path):
    cloud = fused_cloud(views(corner), 0.05)
    path = tmp_path / "dense.ply"
    path.write_bytes(ply_bytes(cloud))
    read = trimesh.load(path)
    np.testing.assert_allclose(read.vertices, cloud.xyz, atol=1e-6)
    np.testing.assert_array_equal(np.asarray(read.colors)[:, :3], cloud.rgb)
