"""Photos' cameras that look at a mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from room2dgs.runs.page.mesh_views import mesh_rendered

WALL_Z = 2.0


@pytest.mark.parametrize("winding", [1, -1])
def test_depth_colour_and_normals_of_a_wall(reported, winding):
    """A square across the left half of what the first camera sees, red below and green above, wound either way."""
    frame = reported.scene.train[0]
    pose = np.eye(4)
    frame = replace(frame, camera=replace(frame.camera, cam_from_world=pose))
    corners = np.array([[-9.0, -9, WALL_Z], [0, -9, WALL_Z], [0, 9, WALL_Z], [-9, 9, WALL_Z]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])[:, ::winding]
    colors = np.array([[0, 255, 0]] * 2 + [[255, 0, 0]] * 2, np.uint8)  # y is down
    mesh = trimesh.Trimesh(corners, faces, vertex_colors=colors, process=False)
    ((same, view),) = mesh_rendered(mesh, [frame], (0.25, 0.5, 0.75))
    assert same is frame
    row, column = np.mgrid[: frame.camera.height, : frame.camera.width] + 0.5
    cx, cy, fy = frame.camera.K[0, 2], frame.camera.K[1, 2], frame.camera.K[1, 1]
    left = column < cx
    np.testing.assert_array_equal(view.alpha.numpy(), left)
    np.testing.assert_allclose(view.median_depth.numpy(), np.where(left, WALL_Z, 0), atol=1e-5)
    np.testing.assert_allclose(view.normal.numpy()[left], [[0, 0, -1]] * left.sum(), atol=1e-6)
    np.testing.assert_allclose(view.color.numpy()[~left], [[0.25, 0.5, 0.75]] * (~left).sum(), atol=1e-6)
    red = ((row - cy) / fy * WALL_Z + 9) / 18
    np.testing.assert_allclose(view.color.numpy()[left][:, 0], red[left], atol=1e-4)
