"""True normals from meshes and from depth, exact or noisy."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.bench.prior_scores import angles_deg
from room2dgs.bench.prior_truth import fitted_planes, frame_truth, truth_source
from room2dgs.captures.scene import Frame
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera

K = np.array([[130.0, 0, 82.0], [0, 128.0, 58.0], [0, 0, 1]])


@pytest.fixture
def corner(make):
    """A camera that looks into a room's corner, and the room's walls."""
    forward = np.array([0.7, 0.6, -0.4])
    camera = make.camera_at((-0.5, -0.3, 0.2), forward / np.linalg.norm(forward))
    return Camera(K, 160, 120, camera.cam_from_world), Surface(make.room())


def frame_of(folder: Path, camera: Camera, depth: np.ndarray, name: str = "0") -> Frame:
    cv2.imwrite(str(folder / f"{name}.png"), np.round(1000 * depth).astype(np.uint16))
    return Frame(name, camera, folder / f"{name}.jpg", folder / f"{name}.png")


def cast(camera: Camera, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    hits = surface.seen_by(camera)
    normal = camera.turned_to_camera(surface.face_normals[hits.triangle])
    normal = normal.reshape(camera.height, camera.width, 3)
    away = (normal * camera.rays()).sum(axis=-1, keepdims=True) > 0
    return hits.t.reshape(camera.height, camera.width).astype(np.float64), np.where(away, -normal, normal)


def test_planes_through_exact_depth_are_exact_and_a_crease_is_none(corner):
    camera, surface = corner
    depth, normal = cast(camera, surface)
    fitted, residual = fitted_planes(depth, camera, 2)
    flat = residual < 1e-5
    assert flat.mean() > 0.8
    assert angles_deg(fitted[flat], normal[flat]).max() < 0.1
    # windows over a crease mix two walls
    jump = np.abs(np.diff(normal, axis=1)).sum(axis=-1) > 0.1
    assert jump.any() and (residual[:, 1:][jump] > 1e-3).mean() > 0.9


def test_holes_are_no_surface(corner):
    camera, surface = corner
    depth, normal = cast(camera, surface)
    depth[40:60, 50:90] = 0
    fitted, residual = fitted_planes(depth, camera, 2)
    assert not fitted[45:55, 55:85].any() and np.isinf(residual[50, 60])
    beside = residual[38:40, 52:88] < 1e-5  # with most of the window known
    assert angles_deg(fitted[38:40, 52:88][beside], normal[38:40, 52:88][beside]).max() < 0.1


def test_an_exact_mesh_gives_its_own_normals_to_the_creases(corner, tmp_path):
    camera, surface = corner
    depth, normal = cast(camera, surface)
    frame = frame_of(tmp_path, camera, depth)
    assert truth_source([frame], surface) == "mesh"
    truth = frame_truth(frame, surface, "mesh")
    assert angles_deg(truth.normal.reshape(-1, 3), normal.reshape(-1, 3)).max() < 1e-3
    np.testing.assert_allclose(truth.depth, depth, atol=6e-4)


def test_what_stands_before_the_mesh_has_no_normal(corner, tmp_path):
    camera, surface = corner
    depth, _ = cast(camera, surface)
    depth[30:60, 20:50] -= 0.2
    truth = frame_truth(frame_of(tmp_path, camera, depth), surface, "mesh")
    assert not truth.normal[30:60, 20:50].any()
    assert truth.normal[70:100, 20:50].any(axis=-1).all()
    assert (truth.depth[30:60, 20:50] > 0).all()


def noisy(depth: np.ndarray, relative: float = 0.004) -> np.ndarray:
    return depth * (1 + relative * np.random.default_rng(0).normal(size=depth.shape))


def test_a_mesh_beside_noisy_depth_is_fused_and_smoothed(corner, tmp_path):
    camera, surface = corner
    depth, normal = cast(camera, surface)
    frame = frame_of(tmp_path, camera, noisy(depth))
    assert truth_source([frame], surface) == "fused mesh"
    truth = frame_truth(frame, surface, "fused mesh").normal
    known = truth.any(axis=-1)
    assert known.mean() > 0.8
    # the mesh itself is exact here: what is off are windows over creases
    assert np.median(angles_deg(truth[known], normal[known])) < 0.01


def test_without_a_mesh_depth_tells_whether_it_is_exact(corner, tmp_path):
    camera, surface = corner
    depth, normal = cast(camera, surface)
    exact, sensor = frame_of(tmp_path, camera, depth, "1"), frame_of(tmp_path, camera, noisy(depth), "2")
    assert truth_source([exact], None) == "depth"
    assert truth_source([sensor], None) == "sensor depth"
    for frame, source, most in ((exact, "depth", 1.5), (sensor, "sensor depth", 8.0)):
        truth = frame_truth(frame, None, source).normal
        known = truth.any(axis=-1)
        assert known.mean() > 0.7
        assert angles_deg(truth[known], normal[known]).mean() < most


def test_a_mesh_of_another_place_is_not_believed(corner, make, tmp_path):
    camera, surface = corner
    frame = frame_of(tmp_path, camera, cast(camera, surface)[0])
    assert truth_source([frame], Surface(make.room((2.0, 1.5, 5.0)))) == "depth"
