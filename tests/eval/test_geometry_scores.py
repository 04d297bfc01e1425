"""Distances to scores."""

import numpy as np
import open3d as o3d
import pytest
import trimesh

from room2dgs.eval.geometry_scores import downsample, nearest_vertices, scores, threshold_name
from room2dgs.eval.surface import Surface


def test_scores_by_hand():
    values = scores(np.array([0.0, 0.04, 0.05, 0.07]), np.array([0.01, 0.03]), 0.05).as_dict()
    assert values["accuracy_m"] == pytest.approx(0.04)
    assert values["completion_m"] == pytest.approx(0.02)
    assert values["precision_5cm"] == 0.5  # strictly below
    assert values["recall_5cm"] == 1
    assert values["f_score_5cm"] == pytest.approx(2 / 3)
    assert values["f_score_2cm"] == pytest.approx(2 * 0.25 * 0.5 / 0.75)


@pytest.mark.parametrize(
    "metres, name", [(0.05, "5cm"), (0.025, "2.5cm"), (0.1, "10cm"), (0.07, "7cm"), (1.0, "100cm")]
)
def test_threshold_names(metres, name):
    assert threshold_name(metres) == name
    assert f"f_score_{name}" in scores(np.zeros(1), np.zeros(1), metres).as_dict()


def test_downsample_is_open3ds():
    points = np.random.default_rng(0).normal(size=(3000, 3)) * [1, 0.3, 2] + [5, -7, 100]
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(0.2)
    theirs = np.asarray(cloud.points)
    ours = downsample(points, 0.2)
    assert len(ours) == len(theirs)
    assert nearest_vertices(ours, theirs).max() < 1e-9


def test_distance_is_to_the_triangle_not_to_its_corners():
    mesh = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]], process=False)
    distance, triangle = Surface(mesh).closest(np.array([[1, 1, 0.5], [-3, -4, 0], [4, 4, 0]]))
    assert distance == pytest.approx([0.5, 5, np.sqrt(8)], rel=1e-6)
    assert triangle.tolist() == [0, 0, 0]


def test_an_empty_mesh_is_infinitely_far_and_stops_no_ray():
    surface = Surface(trimesh.Trimesh(process=False))
    assert np.isinf(surface.closest(np.zeros((2, 3)))[0]).all()
    assert np.isinf(surface.cast(np.zeros(3), np.eye(3)).t).all()


def test_seen_by_gives_z_depth_through_pixel_centres(make):
    camera = make.camera_at((0.2, 0, 0.1), (0, 1, 0), pixels=8)
    slanted = make.quad((-20, 1, -20), (40, 10, 0), (0, 5, 40))
    hits = Surface(slanted).seen_by(camera)
    normal = np.cross([40, 10, 0], [0, 5, 40])
    row, column = 5, 2
    ray = np.linalg.inv(camera.K) @ [column + 0.5, row + 0.5, 1] @ camera.cam_from_world[:3, :3]
    z = normal @ (np.array([-20, 1, -20]) - camera.centre) / (normal @ ray)
    assert hits.t[row * 8 + column] == pytest.approx(z, rel=1e-5)
