"""Fusion of analytic depth: pixel convention, orientation, colour, weights, memory."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from room2dgs import _C
from room2dgs.config import MeshConfig, load_config
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.mesh.clean import clean
from room2dgs.mesh.fuse import NoSurface, fuse
from room2dgs.mesh.tsdf import integrate
from room2dgs.mesh.views import FusedView
from tests.oracles.fusion import fused_voxels

VOXEL = 0.02


def make_config(**changes) -> MeshConfig:
    values = {
        "voxel_m": VOXEL,
        "truncation_voxels": 5.0,
        "max_depth_m": 6.0,
        "min_weight": 1.0,
        "min_triangles": 10,
        "keep_clusters": 5,
        "fill": "none",
    }
    return replace(load_config(["scene.path=x", "out=y"]).mesh, **{**values, **changes})


def make_camera(centre=(0.0, 0.0, 0.0), turn_deg=0.0, focal=120.0) -> Camera:
    angle = np.radians(turn_deg)
    world_from_cam = np.eye(4)
    world_from_cam[:3, :3] = [
        [np.cos(angle), 0, np.sin(angle)],
        [0, 1, 0],
        [-np.sin(angle), 0, np.cos(angle)],
    ]
    world_from_cam[:3, 3] = centre
    K = np.array([[focal, 0, 83.0], [0, focal, 57.5], [0, 0, 1]])
    return Camera(K, 160, 120, np.linalg.inv(world_from_cam))


def plane_view(camera: Camera, normal, offset, color=(0.2, 0.6, 1.0)) -> FusedView:
    """Exact depth of the plane normal . X = offset (world)."""
    rays = camera.world_rays()
    with np.errstate(divide="ignore"):
        depth = (offset - normal @ camera.centre) / (rays @ normal)
    depth[(depth <= 0) | (depth > 4)] = 0
    return FusedView(camera, depth.astype(np.float32), np.broadcast_to(color, (*depth.shape, 3)))


def box_view(camera: Camera, half=(1.2, 1.0, 1.5)) -> FusedView:
    """Exact depth of an axis-aligned box about the origin, from inside."""
    rays = camera.world_rays()
    with np.errstate(divide="ignore"):
        exits = (np.sign(rays) * half - camera.centre) / rays
    depth = exits.min(axis=-1).astype(np.float32)
    return FusedView(camera, depth, np.full((*depth.shape, 3), 128, dtype=np.uint8))


@pytest.mark.parametrize("normal", [(-1.0, -0.5, -1.0), (1.0, -0.5, -1.0), (0.2, 1.0, -1.0)])
def test_slanted_plane_lies_where_half_pixel_centres_put_it(normal):
    """Half a pixel is 6 mm sideways here; taking K's centres at integers would move the plane by 4 mm and more."""
    normal = np.array(normal) / np.linalg.norm(normal)
    offset = normal @ [0.0, 0.0, 1.5]
    cameras = [make_camera((x, y, 0.0)) for x in (-0.02, 0.0, 0.017) for y in (-0.013, 0.01)]
    mesh = clean(integrate((plane_view(camera, normal, offset) for camera in cameras), make_config()))
    corner = np.abs(mesh.vertices - mesh.vertices.mean(axis=0)).max(axis=1)
    inner = mesh.vertices[corner < 0.5]
    assert len(inner) > 1000
    assert abs((inner @ normal - offset).mean()) < 0.1 * VOXEL


def test_box_is_met_on_all_sides_and_faces_look_at_the_camera():
    cameras = [make_camera((0.1, 0.05, -0.1), turn) for turn in range(0, 360, 30)]
    mesh = fuse((box_view(camera) for camera in cameras), make_config(max_error_m=None), lambda _: None)
    half = np.array([1.2, 1.0, 1.5])
    for axis in (0, 2):  # the views' field leaves most of floor and ceiling out
        for side in (-1, 1):
            signed = side * mesh.vertices[:, axis] - half[axis]
            others = np.delete(half - np.abs(mesh.vertices), axis, axis=1).min(axis=1)
            wall = signed[(np.abs(signed) < 0.1) & (others > 0.1)]  # away from the box's edges
            assert len(wall) > 1000
            assert abs(wall.mean()) < 0.1 * VOXEL
    towards = np.einsum("nc,nc->n", mesh.face_normals, [0.1, 0.05, -0.1] - mesh.triangles_center)
    assert (towards > 0).mean() > 0.999


def test_colour_is_the_views_colour_whether_float_or_bytes():
    view = plane_view(make_camera(), np.array([0.0, 0, -1]), -1.5)
    as_bytes = FusedView(view.camera, view.depth, np.round(view.color * 255).astype(np.uint8))
    for one in (view, as_bytes):
        mesh = integrate([one], make_config())
        assert np.abs(mesh.visual.vertex_colors[:, :3].astype(int) - [51, 153, 255]).max() <= 1


@pytest.mark.parametrize("views, min_weight, meshed", [(1, 1, True), (1, 2, False), (2, 2, True), (1, 0, True)])
def test_min_weight_counts_observations(views, min_weight, meshed):
    view = plane_view(make_camera(), np.array([0.0, 0, -1]), -1.5)
    assert (len(integrate([view] * views, make_config(min_weight=min_weight)).faces) > 0) == meshed


def test_min_weight_counts_views_whatever_they_weigh():
    view = plane_view(make_camera(), np.array([0.0, 0, -1]), -1.5)
    light = replace(view, weight=np.full(view.depth.shape, 0.01, np.float32))
    assert len(integrate([light, light], make_config(min_weight=2)).faces)
    heavy = replace(view, weight=np.full(view.depth.shape, 50, np.float32))
    assert not len(integrate([heavy], make_config(min_weight=2)).faces)


def test_a_surface_lies_at_the_weighted_mean_of_what_views_say():
    camera, towards = make_camera(), np.array([0.0, 0, -1])
    near, far = plane_view(camera, towards, -1.47), plane_view(camera, towards, -1.50)
    near, far = (replace(v, weight=np.full(v.depth.shape, w, np.float32)) for v, w in ((near, 3.0), (far, 1.0)))
    mesh = clean(integrate([near, far], make_config()))
    assert np.median(mesh.vertices[:, 2]) == pytest.approx(1.4775, abs=1e-3)
    without = replace(far, weight=np.zeros_like(far.weight))
    assert np.median(integrate([near, without], make_config()).vertices[:, 2]) == pytest.approx(1.47, abs=1e-3)


def test_the_kernel_is_the_plain_sum():
    """Every voxel of some blocks, also those behind the camera and beside the photo, with NaN nowhere."""
    rng = np.random.default_rng(0)
    views = []
    for k in range(3):
        view = box_view(make_camera((0.0137 + 0.1 * k, 0.0511, -0.1), 1.3 + 25 * k, 117.31))
        depth = np.where(rng.random(view.depth.shape) < 0.1, 0, view.depth).astype(np.float32)
        normal = rng.normal(size=(*depth.shape, 3))  # half of them look away
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        normal[rng.random(depth.shape) < 0.1] = 0
        weight = rng.random(depth.shape).astype(np.float32)
        views.append(replace(view, depth=depth, weight=weight, normal=normal.astype(np.float32) if k else None))
    block = np.array([[x, y, z] for x in range(-8, 8, 3) for y in (-4, 0, 3) for z in range(-2, 12, 2)], np.int32)
    parts = [np.zeros((len(block), size), np.float32) for size in (512, 512, 512, 1536)]
    for view in views:
        pixel_from_voxel = view.camera.K @ view.camera.cam_from_world[:3]
        pixel_from_voxel[:, :3] *= VOXEL
        photo = np.ones((*view.depth.shape, 3), np.float32)
        rows = np.arange(len(block))
        normal = np.zeros_like(photo) if view.normal is None else view.normal
        maps = (view.depth, normal, view.weight, photo)
        _C.fuse_depth(block, rows, *parts, *maps, pixel_from_voxel, VOXEL, 5 * VOXEL)
    inner = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1)[..., ::-1].reshape(-1, 3)  # z, y, x
    voxels = VOXEL * (8 * block[:, None] + inner).reshape(-1, 3)
    distance, weight, count = fused_voxels(views, voxels, 5 * VOXEL)
    assert 0.05 < (count > 1).mean() < 0.95
    np.testing.assert_array_equal(parts[2].ravel(), count)
    np.testing.assert_allclose(parts[1].ravel(), weight, atol=1e-5)
    np.testing.assert_allclose(parts[0].ravel(), distance, atol=1e-5)


@pytest.mark.parametrize("rows, words", [([0, 2], "not there"), ([-1, 0], "not there"), ([1, 1], "twice")])
def test_a_block_is_taken_once_and_must_be_there(rows, words):
    parts = [np.zeros((2, size), np.float32) for size in (512, 512, 512, 1536)]
    maps = [np.ones((4, 5, *channels), np.float32) for channels in ((), (3,), (), (3,))]
    with pytest.raises(ValueError, match=words):
        _C.fuse_depth(np.zeros((2, 3), np.int32), np.array(rows), *parts, *maps, np.eye(3, 4), 0.02, 0.1)


def with_normals(view: FusedView, normal: np.ndarray) -> FusedView:
    return replace(view, normal=np.broadcast_to(normal, (*view.depth.shape, 3)).astype(np.float32))


def test_with_its_normals_a_slanted_plane_is_flat():
    """Without them a voxel has the distance of the middle of the pixel that sees it: steps."""
    normal = np.array([np.sin(1.0), 0.0, -np.cos(1.0)])
    view = plane_view(make_camera(), normal, normal @ [0.0, 0.0, 1.5])
    meshes = [clean(integrate([one], make_config())) for one in (view, with_normals(view, normal))]
    stepped, flat = (np.abs(mesh.vertices @ normal - normal @ [0.0, 0.0, 1.5]).max() for mesh in meshes)
    assert stepped > 0.1 * VOXEL and flat < 0.005 * VOXEL


def test_views_from_different_angles_count_alike():
    """Along the axis a surface seen at 60 degrees is twice as far away: that view would have twice the say."""
    cameras = make_camera((0.0, 0.0, 0.0)), make_camera((-1.5 * np.tan(1.05), 0.0, 0.0), turn_deg=60)
    normal = np.array([0.0, 0.0, -1.0])
    apart = 0.4 * VOXEL
    views = [plane_view(camera, normal, -1.5 + side * apart) for camera, side in zip(cameras, (1, -1), strict=True)]
    middles = []
    for both in (views, [with_normals(view, normal) for view in views]):
        mesh = clean(integrate(both, make_config(min_weight=2)))
        near = (np.abs(mesh.vertices[:, :2]) < 0.2).all(axis=1)
        assert near.sum() > 100
        middles.append(mesh.vertices[near, 2].mean() - 1.5)
    assert abs(middles[0]) > 0.1 * apart and abs(middles[1]) < 0.05 * apart


def test_far_depth_is_left_out():
    view = plane_view(make_camera(), np.array([0.0, 0, -1]), -1.5)
    assert len(integrate([view], make_config(max_depth_m=1.4)).faces) == 0


def test_far_from_the_worlds_origin_nothing_is_lost():
    shift = np.array([50_000.0, -20_000.0, 30.0])  # float32 has 4 mm there
    normal = np.array([0.0, 0.6, -0.8])
    near = integrate([plane_view(make_camera(), normal, -1.2)], make_config())
    far = integrate([plane_view(make_camera(shift), normal, -1.2 + normal @ shift)], make_config())
    assert len(far.faces) == len(near.faces)
    order = [np.lexsort(np.round(m.vertices - s, 4).T) for m, s in ((near, 0), (far, shift))]
    assert np.abs(near.vertices[order[0]] - (far.vertices[order[1]] - shift)).max() < 1e-3


def test_views_are_not_kept():
    alive = []

    def views():
        for k in range(4):
            view = plane_view(make_camera((0.01 * k, 0, 0)), np.array([0.0, 0, -1]), -1.5)
            alive.append(weakref.ref(view))
            yield view
            del view
            gc.collect()
            # the fusing loop may still hold the latest, none before it
            assert sum(ref() is not None for ref in alive) <= 1

    assert len(integrate(views(), make_config()).faces)


def test_nothing_to_mesh_names_the_settings():
    camera = make_camera()
    empty = FusedView(camera, np.zeros((120, 160), np.float32), np.zeros((120, 160, 3), np.float32))
    with pytest.raises(InputError, match=r"mesh\.min_alpha"):
        fuse([empty], make_config(), lambda _: None)
    speck = plane_view(camera, np.array([0.0, 0, -1]), -1.5)
    with pytest.raises(InputError, match=r"mesh\.min_triangles"):
        fuse([speck], make_config(min_triangles=10**7), lambda _: None)


def test_a_view_with_hardly_any_depth_is_passed_over():
    camera = make_camera()
    sparse = plane_view(camera, np.array([0, 0, 1.0]), 2.0)
    depth = np.zeros_like(sparse.depth)
    depth[1, 1] = 2.0
    with pytest.raises(NoSurface, match="no surface came out"):
        fuse([FusedView(camera, depth, sparse.color)], make_config(), print)


@pytest.mark.parametrize(
    "changes, helps, not_these",
    [
        ({}, ["train longer", "mesh.voxel_m=0.05"], ["min_weight", "max_depth_m", "min_alpha"]),
        ({"min_weight": 3.0}, ["lower mesh.min_weight=3"], ["max_depth_m"]),
        ({"source": "depth"}, ["add photos of the same places", "mesh.voxel_m"], ["train", "min_weight"]),
        ({"max_depth_m": 1.0}, ["train longer", "mesh.max_depth_m=1", "mesh.min_alpha=0.5", "max_angle"], ["weight"]),
        ({"max_depth_m": 1.0, "min_alpha": 0.0}, ["mesh.max_depth_m=1"], ["min_alpha"]),
        ({"max_depth_m": 1.0, "source": "depth"}, ["add photos", "mesh.max_depth_m=1"], ["alpha", "angle"]),
        ({"max_depth_m": 1.0, "max_expected_m": 0.2}, ["raise mesh.max_expected_m=0.2"], ["weight"]),
        ({"max_depth_m": 1.0, "source": "depth", "max_expected_m": 0.2}, ["mesh.max_expected_m=0.2"], ["train"]),
        ({"max_depth_m": 1.0, "source": "stereo", "max_expected_m": 0.2}, ["add photos"], ["train", "expected"]),
    ],
)
@pytest.mark.parametrize("space", ["bounded", "contracted"])
def test_what_is_said_of_no_surface_helps_under_the_settings_in_force(changes, helps, not_these, space):
    camera = make_camera()
    wall = plane_view(camera, np.array([0, 0, 1.0]), 2.0)
    speck = np.zeros_like(wall.depth)
    speck[1, 1] = 2.0  # a pixel is no surface
    view = FusedView(camera, speck, wall.color)
    with pytest.raises(NoSurface) as said:
        fuse(iter([view]), make_config(voxel_m=0.05, space=space, **changes), print)
    assert all(words in str(said.value) for words in helps)
    assert not any(words in str(said.value) for words in not_these)


def test_depth_that_weighs_nothing_is_not_taken_for_depth():
    camera = make_camera()
    wall = plane_view(camera, np.array([0, 0, 1.0]), 2.0)
    with pytest.raises(NoSurface, match="no pixel of the depth maps may be fused"):
        fuse([FusedView(camera, wall.depth, wall.color, np.zeros_like(wall.depth))], make_config(), print)
