"""Seeds from depth maps: a wall seen by cameras that step sideways."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import load_config
from room2dgs.geometry.camera import Camera
from room2dgs.seeds.depth_seeds import away_from, prior_surface
from room2dgs.train.model import new_model

WIDTH, HEIGHT, WALL_M, VOXEL_M = 96, 72, 2.0, 0.1
K = np.array([[80.0, 0, 48.0], [0, 80.0, 36.0], [0, 0, 1.0]])


@pytest.fixture
def frames(tmp_path: Path) -> list[Frame]:
    made = []
    for index in range(5):
        cam_from_world = np.eye(4)
        cam_from_world[0, 3] = -0.1 * index
        path = tmp_path / f"{index}.png"
        cv2.imwrite(str(path), np.full((HEIGHT, WIDTH, 3), (30, 60, 90), np.uint8))  # BGR
        made.append(Frame(f"{index:06d}", Camera(K, WIDTH, HEIGHT, cam_from_world), path))
    return made


def wall(frames: list[Frame], noise_m: float = 0.0) -> dict[str, ViewMaps]:
    rng = np.random.default_rng(0)
    maps = {f.name: np.float32(WALL_M) + rng.uniform(-noise_m, noise_m, (HEIGHT, WIDTH)) for f in frames}
    return {name: ViewMaps(depth=depth.astype(np.float32)) for name, depth in maps.items()}


def test_seeds_lie_on_the_wall_and_face_the_cameras(frames):
    surface = prior_surface(frames, wall(frames), VOXEL_M)
    np.testing.assert_allclose(surface.xyz[:, 2], WALL_M, atol=1e-6)
    np.testing.assert_allclose(surface.normals, np.tile([0.0, 0.0, -1.0], (len(surface.xyz), 1)), atol=1e-6)
    np.testing.assert_allclose(surface.rgb, np.tile(np.array([90, 60, 30]) / 255, (len(surface.xyz), 1)), atol=1e-6)
    # a cell for each 10 cm x 10 cm that three views share: at least the middle view's image without a border
    seen = (WIDTH - 8) / 80 * WALL_M * (HEIGHT - 8) / 80 * WALL_M
    assert len(surface.xyz) >= 0.8 * seen / VOXEL_M**2
    assert len(np.unique(surface.cells, axis=0)) == len(surface.cells)


def test_a_wall_on_the_border_of_two_layers_of_cells_is_seeded_once(frames):
    surface = prior_surface(frames, wall(frames, noise_m=2e-3), VOXEL_M)
    apart, _ = cKDTree(surface.xyz).query(surface.xyz, k=2)
    assert apart[:, 1].min() > 0.5 * VOXEL_M
    assert len(surface.xyz) > 100


def test_what_one_view_says_against_the_others_is_not_believed(frames):
    priors = wall(frames)
    liar = frames[2].name
    priors[liar].depth[:] = 1.5
    surface = prior_surface(frames, priors, VOXEL_M)
    assert len(surface.xyz)
    np.testing.assert_allclose(surface.xyz[:, 2], WALL_M, atol=1e-6)


def test_what_others_look_through_is_not_believed_though_some_agree(frames):
    priors = wall(frames)
    for frame in frames[:2]:
        priors[frame.name].depth[:] = 1.5
    priors[frames[2].name].depth[:] = 1.5  # three agree, two see the wall behind
    lonely = prior_surface(frames, priors, VOXEL_M)
    seen_by_all = (lonely.xyz[:, 0] > -0.3) & (lonely.xyz[:, 0] < 0.7)
    assert not (np.abs(lonely.xyz[seen_by_all, 2] - 1.5) < 0.2).any()


def test_one_view_alone_gives_nothing_if_it_does_not_know_its_error(frames):
    assert len(prior_surface(frames[:1], wall(frames), VOXEL_M).xyz) == 0
    assert len(prior_surface(frames, {}, VOXEL_M).xyz) == 0


def sure(maps: dict[str, ViewMaps], confidence: float) -> dict[str, ViewMaps]:
    """Depth whose expected error is known."""
    known = np.full((HEIGHT, WIDTH), confidence, np.float32)
    return {name: one._replace(depth_confidence=known) for name, one in maps.items()}


def test_one_view_that_knows_its_error_gives_seeds_unless_that_is_large(frames):
    alone = prior_surface(frames[:1], sure(wall(frames), 0.9), VOXEL_M)
    assert len(alone.xyz) > 100
    np.testing.assert_allclose(alone.xyz[:, 2], WALL_M, atol=1e-6)
    assert len(prior_surface(frames[:1], sure(wall(frames), 0.0), VOXEL_M).xyz) == 0
    # cells on the border of the image have few pixels, which are enough only if they are sure
    assert len(prior_surface(frames[:1], sure(wall(frames), 0.002), VOXEL_M).xyz) < 0.7 * len(alone.xyz)


def test_seeds_lie_where_the_surer_views_have_the_wall(frames):
    """Two views 1 % too far and hardly sure, three right and sure: the mean is that of the three."""
    maps = sure(wall(frames), 0.9)
    for frame in frames[3:]:
        maps[frame.name].depth[:] *= 1.01
        maps[frame.name] = maps[frame.name]._replace(depth_confidence=np.full((HEIGHT, WIDTH), 1e-3, np.float32))
    xyz = prior_surface(frames, maps, VOXEL_M).xyz
    seen_by_all = (xyz[:, 0] > -0.3) & (xyz[:, 0] < 0.7)
    assert np.abs(xyz[seen_by_all, 2] - WALL_M).max() < 0.002


def test_cells_that_hold_a_sparse_point_are_left_to_it(frames):
    surface = prior_surface(frames, wall(frames), VOXEL_M)
    points = surface.xyz[::7]
    left = away_from(surface, points, VOXEL_M)
    assert len(left.xyz) == len(surface.xyz) - len(points)
    assert cKDTree(points).query(left.xyz)[0].min() > 0


@pytest.mark.parametrize(("init", "more"), [("sfm", False), ("sfm+depth", True)])
def test_a_new_model_has_them_if_asked(frames, tmp_path, init, more):
    config = load_config([f"scene.path={tmp_path}", "out=x", f"seeds.init={init}"])
    xyz = np.random.default_rng(1).uniform(-0.3, 0.3, (40, 3)) + np.array([0.2, 0.0, WALL_M])
    points = PointCloud(xyz, np.zeros((40, 3), np.uint8))
    scene = Scene(tmp_path, tuple(frames), ())
    model = new_model(scene, points, config, wall(frames))
    assert (model.seeds > len(xyz) + 50) == more
    assert model.seeds == new_model(scene, points, config).seeds or more


def test_a_new_model_goes_on_beyond_the_photos_if_asked(frames, tmp_path):
    scene, none = Scene(tmp_path, tuple(frames), ()), PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    given = [f"scene.path={tmp_path}", "out=x", "seeds.init=sfm+depth", "seeds.per_seed=1"]
    seen, more = (
        new_model(scene, none, load_config([*given, f"seeds.beyond_m={beyond_m}"]), wall(frames)).splats(0).centers
        for beyond_m in (0.0, 0.3)
    )
    new = more[len(seen) :].detach().numpy().astype(np.float64)
    assert len(new) > 50 and (more[: len(seen)] == seen).all()
    assert new[:, 0].max() > seen[:, 0].max() + 0.25
    for frame in frames:
        pixel, _ = frame.camera.project(new)
        assert not (np.abs(pixel - (WIDTH / 2, HEIGHT / 2)) < (WIDTH / 2 - 6, HEIGHT / 2 - 6)).all(axis=1).any()
