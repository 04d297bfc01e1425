"""The surface through sparse points of a room whose walls are known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.config import MeshConfig, load_config
from room2dgs.mesh.finish import NoSurface
from room2dgs.mesh.sparse_surface import surface_of_points

SHIFT = np.array([50_000.0, -20_000.0, 30.0])  # float32 has 4 mm there


def config(**changes) -> MeshConfig:
    values = {"voxel_m": 0.04, "max_depth_m": 8.0, **changes}
    return replace(load_config(["scene.path=x", "out=y"]).mesh, **values)


def frames_of(cameras) -> list:
    return [SimpleNamespace(name=str(index), camera=camera) for index, camera in enumerate(cameras)]


@pytest.fixture(scope="module")
def sampled() -> np.ndarray:
    """(4000, 3) points on the walls of a room of 4 x 3 x 2.5 m about the origin."""
    box = trimesh.creation.box((4.0, 3.0, 2.5))
    return np.asarray(trimesh.sample.sample_surface(box, 4000, seed=0)[0])


def off_walls(vertices: np.ndarray) -> np.ndarray:
    """(N,) metres to the nearest plane of a wall."""
    return np.abs(np.abs(vertices) - np.array([2.0, 1.5, 1.25])).min(axis=1)


def coloured(xyz: np.ndarray) -> PointCloud:
    """Red where x > 0, blue elsewhere."""
    return PointCloud(xyz, np.where(xyz[:, :1] > 0, [[200, 0, 0]], [[0, 0, 200]]).astype(np.uint8))


def test_it_lies_on_the_walls_looks_inwards_and_has_the_points_colours(make, sampled):
    mesh = surface_of_points(coloured(sampled), frames_of(make.all_around()), config(), lambda line: None)
    dense = trimesh.sample.sample_surface(mesh, 20_000, seed=0)[0]
    assert np.median(off_walls(dense)) < 0.01 and np.quantile(off_walls(dense), 0.9) < 0.05
    assert mesh.area > 0.6 * 2 * (4 * 3 + 4 * 2.5 + 3 * 2.5)
    inwards = np.einsum("nc,nc->n", mesh.face_normals, -mesh.triangles_center) > 0
    assert np.average(inwards, weights=mesh.area_faces) > 0.99
    red = np.asarray(mesh.visual.vertex_colors)[:, 0].astype(int)
    away = np.abs(mesh.vertices[:, 0]) > 0.4  # from where the colours meet
    np.testing.assert_allclose(red[away], 200 * (mesh.vertices[away, 0] > 0), atol=30)


def test_far_from_the_worlds_origin_nothing_is_lost(make, sampled):
    frames = frames_of(make.all_around(SHIFT))
    mesh = surface_of_points(coloured(sampled + SHIFT), frames, config(), lambda line: None)
    assert np.median(off_walls(mesh.vertices - SHIFT)) < 0.01


def test_the_same_bits_come_out_again(make, sampled):
    frames = frames_of(make.all_around())
    first, second = (surface_of_points(coloured(sampled), frames, config(), lambda line: None) for _ in range(2))
    assert first.export(file_type="ply") == second.export(file_type="ply")


def test_what_no_point_says_anything_of_is_left_open(make, sampled):
    """Without a ceiling Poisson would close the room above; that part has the fewest points near it."""
    below = sampled[sampled[:, 2] < 1.24]
    mesh = surface_of_points(coloured(below), frames_of(make.all_around()), config(), lambda line: None)
    across = mesh.vertices[(np.abs(mesh.vertices[:, 0]) < 1.5) & (np.abs(mesh.vertices[:, 1]) < 1.0)]
    assert across[:, 2].max() < 0.5


@pytest.mark.parametrize("count", [16, 17, 25, 60])
@pytest.mark.parametrize("flat", [0, 1, 2])
def test_few_points_give_a_mesh_or_a_sentence(make, count, flat):
    """In space, in a plane, on a line: open3d ends the process over some clouds that are fewer still."""
    xyz = np.random.default_rng(count).random((count, 3))
    xyz += np.array([1, -0.5, -0.5])
    xyz[:, :flat] = 1.5
    try:
        mesh = surface_of_points(
            coloured(xyz), frames_of(make.all_around()), config(min_triangles=1), lambda line: None
        )
    except NoSurface:
        return
    assert len(mesh.faces) and np.isfinite(mesh.vertices).all()


def test_too_little_names_what_to_do(make, sampled):
    frames = frames_of(make.all_around())
    with pytest.raises(NoSurface, match=r"^0 of 0 sparse points are seen"):
        surface_of_points(coloured(np.zeros((0, 3))), frames, config())
    with pytest.raises(NoSurface, match=r"mesh\.max_depth_m=0\.5 away.*raise it"):
        surface_of_points(coloured(sampled), frames, config(max_depth_m=0.5))
    with pytest.raises(NoSurface, match=r"within mesh\.voxel_m=0\.04 of each other"):
        surface_of_points(coloured(np.tile([1.0, 0.2, 0.1], (50, 1))), frames, config())
    with pytest.raises(NoSurface, match=r"mesh\.min_triangles=10000000"):
        surface_of_points(coloured(sampled), frames, config(min_triangles=10**7), lambda line: None)
