"""Which pixels are fused, and what a view hands to the volume."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import MeshConfig, load_config
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.views import fused_view, trusted_view, valid_depth


def make_camera(width=40, height=30, focal=30.0, cam_from_world=None) -> Camera:
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(K, width, height, np.eye(4) if cam_from_world is None else cam_from_world)


def make_config(**changes) -> MeshConfig:
    values = {"depth": "median", "max_depth_m": 5.0, "min_alpha": 0.5, "max_angle_deg": 60.0}
    return replace(load_config(["scene.path=x", "out=y"]).mesh, **{**values, **changes})


def make_rendering(camera, normal=(0.0, 0.0, -1.0), depth=2.0, alpha=1.0):
    shape = (camera.height, camera.width)
    return SimpleNamespace(
        color=torch.full((*shape, 3), 1.5),
        alpha=torch.full(shape, alpha),
        depth=torch.full(shape, depth + 1),
        median_depth=torch.full(shape, depth),
        normal=torch.tensor(normal).expand(*shape, 3).clone(),
    )


def test_each_condition_removes_its_own_pixels():
    camera, config = make_camera(), make_config()
    rendering = make_rendering(camera)
    rendering.alpha[0, 18] = 0.49
    rendering.median_depth[1, 18] = 5.01
    rendering.median_depth[2, 18] = 0.0
    rendering.median_depth[3, 18] = float("nan")
    rendering.normal[4, 18] = 0.0
    rendering.normal[5, 18] = float("nan")
    expected = np.ones((30, 40), dtype=bool)
    expected[:6, 18] = False
    assert np.array_equal(valid_depth(rendering, camera, config), expected)


@pytest.mark.parametrize("angle, kept", [(59.0, True), (61.0, False)])
@pytest.mark.parametrize("sign", [1, -1])
def test_angle_is_taken_to_the_pixels_own_ray_in_the_world_frame(angle, kept, sign):
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # the camera looks along the world's x
    pose = np.eye(4)
    pose[:3, :3] = turn.T
    pose[:3, 3] = [0.3, -0.2, 1.0]
    camera = make_camera(cam_from_world=pose)
    ray = camera.world_rays()[3, 5]
    ray /= np.linalg.norm(ray)
    side = np.cross(ray, [0, 0, 1])
    side /= np.linalg.norm(side)
    normal = sign * (np.cos(np.radians(angle)) * ray + np.sin(np.radians(angle)) * side)
    rendering = make_rendering(camera, tuple(0.3 * normal))  # length must not matter
    assert valid_depth(rendering, camera, make_config())[3, 5] == kept


@pytest.mark.parametrize("kind, metres", [("median", 2.0), ("expected", 3.0)])
def test_fused_view_takes_the_chosen_depth_and_clips_colour(kind, metres):
    camera = make_camera()
    rendering = make_rendering(camera)
    rendering.alpha[0, 0] = 0.0
    view = fused_view(rendering, camera, make_config(depth=kind))
    assert view.depth.dtype == np.float32
    assert view.depth[0, 0] == 0
    assert view.depth[1, 1] == metres
    assert view.color.max() == 1.0


def test_smooth_depth_is_expected_on_one_surface_and_median_across_an_edge():
    camera = make_camera()
    rendering = make_rendering(camera)
    rendering.depth[:] = 2.015
    rendering.depth[0], rendering.depth[1], rendering.depth[2] = 2.03, 1.97, float("nan")
    view = fused_view(rendering, camera, make_config(depth="smooth"))
    assert view.depth[3, 18] == np.float32(2.015)
    assert (view.depth[:3, 18] == 2.0).all()


def test_normals_are_unit_and_never_nan():
    camera = make_camera()
    rendering = make_rendering(camera, (0.0, 0.3, -0.4))
    rendering.normal[0, 0], rendering.normal[0, 1] = float("nan"), 0.0
    normal = fused_view(rendering, camera, make_config()).normal
    assert (normal[0, :2] == 0).all()
    assert np.allclose(normal[1, 1], [0, 0.6, -0.8])


def test_own_depth_is_fused_where_it_is_trusted():
    """A confidence of 0.1 expects 7.5 %, one of 0.8 1.25 %: at 2 m 15 and 2.5 cm."""
    camera = make_camera()
    depth = np.full((camera.height, camera.width), 2.0, np.float32)
    sure = np.full(depth.shape, 0.8, np.float32)
    sure[:, 0], depth[:, 1], depth[:, 2], sure[:, 3] = 0.1, 0.0, 50.0, 0.0
    config = make_config(max_expected_m=0.14)
    view = trusted_view(ViewMaps(depth=depth, depth_confidence=sure), camera, np.zeros((*depth.shape, 3)), config)
    assert (view.depth[:, :4] == 0).all() and (view.depth[:, 4:] == 2).all()
    assert view.weight[0, 4] == pytest.approx((0.8 / 2) ** 2)
    for maps, other in (
        (ViewMaps(depth=depth, depth_confidence=sure), replace(config, max_expected_m=0.16)),
        (ViewMaps(depth=depth, depth_confidence=sure), replace(config, max_expected_m=None)),
        (ViewMaps(depth=depth), config),  # no confidence: all of it
    ):
        assert (trusted_view(maps, camera, np.zeros((*depth.shape, 3)), other).depth[:, 0] == 2).all()


def test_own_depth_brings_its_normals():
    camera = make_camera()
    depth = np.full((camera.height, camera.width), 2.0, np.float32)
    normal = np.broadcast_to(np.float32([0, 0.6, -0.8]), (*depth.shape, 3))
    maps, color = ViewMaps(depth=depth, normal=normal), np.zeros((*depth.shape, 3))
    assert trusted_view(maps, camera, color, make_config()).normal is normal
    assert trusted_view(maps._replace(normal=None), camera, color, make_config()).normal is None


@pytest.mark.parametrize("scale", [1, 5])
def test_a_rendering_is_fused_where_its_prior_is_not_expected_to_be_far_off(scale):
    """By maps of any size; where there is no prior depth nobody knows, and the rendering stays."""
    camera = make_camera()
    rendering = make_rendering(camera)
    sure = np.full((30 // scale, 40 // scale), 0.8, np.float32)
    sure[:, : 20 // scale], sure[0] = 0.1, 0
    inside = (slice(2 * scale, None), slice(None, 20 - scale))
    for most, left in ((0.14, 0), (0.16, 2), (None, 2)):
        depth = fused_view(rendering, camera, make_config(max_expected_m=most), sure).depth
        assert (depth[inside] == left).all() and (depth[:, 20 + scale :] == 2).all(), most
        assert (depth[: max(1, scale // 2)] == 2).all()
    assert (fused_view(rendering, camera, make_config(max_expected_m=0.01)).depth == 2).all()  # nobody was asked
