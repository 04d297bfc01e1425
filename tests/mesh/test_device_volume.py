"""Fusion by block code as plain C++: the CPU kernel's blocks and bits, the same mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from room2dgs import _C
from room2dgs.config import MeshConfig, load_config
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.kernels.builds import PLAIN, set_order
from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.mesh import device_volume, tsdf
from room2dgs.mesh.fuse import fuse
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.voxel_table import block_coordinates

HALF = np.array([1.2, 1.0, 1.5])
WORLD = np.array([3.0, -7.0, 0.4])  # the room's middle


def make_config(**changes) -> MeshConfig:
    settings = load_config(["scene.path=x", "out=y"]).mesh
    return replace(
        settings, **{"voxel_m": 0.03, "min_weight": 1.0, "min_triangles": 10, "max_error_m": None, **changes}
    )


def views(count: int, seed: int = 0) -> list[FusedView]:
    """A box from inside, with holes, noise and weights; sizes, lenses and directions differ."""
    random, made = np.random.default_rng(seed), []
    for k in range(count):
        width, height = 83 + 4 * k, 61 + k
        pose = np.eye(4)
        pose[:3, :3] = np.linalg.qr(random.normal(size=(3, 3)))[0]
        pose[:3, :3] *= np.sign(np.linalg.det(pose[:3, :3]))
        centre = WORLD + random.uniform(-0.4, 0.4, 3)
        pose[:3, 3] = -pose[:3, :3] @ centre
        K = np.array(
            [[random.uniform(40, 120), 0, width / 2 + 1.3], [0, random.uniform(40, 120), height / 2], [0, 0, 1]]
        )
        camera = Camera(K, width, height, pose)
        rays = camera.world_rays()
        depth = ((np.sign(rays) * HALF + WORLD - centre) / rays).min(axis=-1) + random.normal(0, 0.004, (height, width))
        depth[random.random(depth.shape) < 0.1] = 0
        depth[0, 0], depth[4, 4] = np.nan, np.inf
        color = random.integers(0, 256, (height, width, 3)).astype(np.uint8)
        weight = random.random(depth.shape).astype(np.float32) if k % 2 else None
        normal = -rays / np.linalg.norm(rays, axis=-1, keepdims=True) if k % 4 else None
        normal = None if normal is None else normal.astype(np.float32)
        made.append(FusedView(camera, depth.astype(np.float32), color if k % 3 else color / 255, weight, normal))
    return made


def blocks_across(view: FusedView, origin: np.ndarray, voxel: float, reach: float, shift: np.ndarray) -> set:
    """Of four points across the surface at every second pixel, each moved by `shift`."""
    camera, each = view.camera, (slice(0, view.camera.height // 2 * 2, 2), slice(0, view.camera.width // 2 * 2, 2))
    rays, depth = camera.world_rays()[each], view.depth[each][..., None].astype(np.float64)
    facing = (view.normal * camera.world_rays()).sum(axis=-1)[each] < 0
    across = np.where(facing[..., None], view.normal[each], rays)
    points = camera.centre - origin + rays * depth
    points = np.stack([points + reach * s * across for s in (-1, -1 / 3, 1 / 3, 1)])[:, depth[..., 0] > 0]
    return {*map(tuple, np.floor((points.reshape(-1, 3) + shift) / (8 * voxel)).astype(int))}


@pytest.mark.parametrize("voxel", [0.002, 0.005, 0.02])
@pytest.mark.parametrize("truncation", [1, 8])
def test_no_block_of_a_wall_is_jumped_over(voxel, truncation):
    """Also where pixels are farther apart than blocks, and the truncation is as wide as one."""
    camera = replace(views(1)[0].camera, cam_from_world=np.eye(4))
    z = 3.0 + 3.5 * voxel
    depth = np.full((camera.height, camera.width), z, np.float32)
    normal = np.zeros((*depth.shape, 3), np.float32)
    normal[..., 2] = -1
    keys = tsdf.touched(depth, normal, camera.K, np.eye(4), voxel, truncation * voxel)
    found = {*map(tuple, block_coordinates(keys))}
    corners = np.array([[3.0, 3.0], np.array(camera.size) - 3.0])
    low, high = camera.unproject(corners, np.array([z, z]))
    across, down = (np.arange(*np.floor([low[k], high[k]] / np.array(8 * voxel)).astype(int)) for k in (0, 1))
    depths = np.unique(np.floor((z + np.array([-truncation, 0, truncation]) * voxel) / (8 * voxel)).astype(int))
    wanted = {(x, y, k) for x in across for y in down for k in depths}
    assert len(wanted) > 50 and wanted <= found
    on_device = device_volume.touched(
        *map(torch.from_numpy, (depth, normal)), camera.K, np.eye(4), voxel, truncation * voxel, PLAIN
    )
    assert on_device.tolist() == keys.tolist()


@pytest.mark.parametrize("voxel", [0.02, 0.11])
def test_blocks_lie_across_the_surface(voxel):
    reach = 5 * voxel
    shifts = 1e-5 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])  # float32 on a border
    for k, made in enumerate(views(4)):
        normal = np.random.default_rng(k).normal(size=(*made.depth.shape, 3))
        normal[normal[..., 0] > 1] = 0
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
        depth = np.where(made.depth < 9, made.depth, 0).astype(np.float32)
        view = replace(made, depth=depth, normal=normal.astype(np.float32))
        origin = tsdf.start_of(view.camera, voxel)
        cam_from_local, _ = tsdf.camera_in_volume(view.camera, origin, voxel)
        at = (view.camera.K, cam_from_local, voxel, reach)
        keys = tsdf.touched(view.depth, view.normal, *at)
        found = {*map(tuple, block_coordinates(keys))}
        moved = [blocks_across(view, origin, voxel, reach, shift) for shift in shifts]
        assert len(found) > 10 and set.intersection(*moved) <= found <= set.union(*moved)
        on_device = device_volume.touched(*map(torch.from_numpy, (view.depth, view.normal)), *at, PLAIN)
        assert on_device.tolist() == keys.tolist()


def test_voxels_have_the_cpu_kernels_bits_in_any_order():
    random = np.random.default_rng(1)
    view = views(2)[1]
    block = np.unique(random.integers(-6, 6, (300, 3)).astype(np.int32), axis=0)
    rows = random.permutation(len(block) + 7)[: len(block)]
    start = [random.random((len(block) + 7, size), np.float32) for size in (512, 512, 512, 1536)]
    photo = random.random((*view.depth.shape, 3), np.float32)
    _, matrix = tsdf.camera_in_volume(view.camera, WORLD, 0.03)
    normal = random.normal(size=(*view.depth.shape, 3)).astype(np.float32)
    view_of = (view.depth, normal, view.weight, photo, matrix, 0.03, 0.15)

    def fused(kernel, rows, *queue):
        parts = [part.copy() for part in start]
        kernel(block, rows, *parts, *view_of, *queue)
        return parts

    expected = fused(_C.fuse_depth, rows)
    assert 0.01 < (expected[2] != start[2]).mean() < 0.95
    for order in (0, 1, 99):
        found = fused(_C.device.fuse_depth, rows, order)
        assert all(np.array_equal(a, b) for a, b in zip(found, expected, strict=True))
    rows[3], rows[5] = -1, len(block) + 7  # passed over: nobody on the host can look at them
    away = fused(_C.device.fuse_depth, rows)
    changed = [(part != before).any(axis=1) for part, before in zip(away, start, strict=True)]
    assert np.setdiff1d(changed[2].nonzero()[0], rows).size == 0


def test_the_mesh_is_the_cpus_bit_for_bit():
    config, made = make_config(), views(5)
    cpu = fuse(iter(made), config, lambda _: None)
    assert len(cpu.faces) > 5000
    set_order(3)
    try:
        with cuda_kernels_on_cpu():
            found = fuse(iter(made), config, lambda _: None)
    finally:
        set_order(0)
    as_tensors = [
        FusedView(
            v.camera, *(None if x is None else torch.as_tensor(x) for x in (v.depth, v.color, v.weight, v.normal))
        )
        for v in made
    ]
    with cuda_kernels_on_cpu():
        again = fuse(iter(as_tensors), config, lambda _: None)
    for mesh in (found, again):
        assert np.array_equal(mesh.vertices, cpu.vertices) and np.array_equal(mesh.faces, cpu.faces)
        assert np.array_equal(mesh.visual.vertex_colors, cpu.visual.vertex_colors)


def test_a_contracted_volume_takes_tensors_too():
    config = make_config(space="contracted", voxel_m=0.08, max_depth_m=50.0)
    made = views(2)
    tensors = [replace(v, depth=torch.from_numpy(v.depth), color=torch.from_numpy(v.color), normal=None) for v in made]
    made, tensors = ([replace(v, weight=None) for v in both] for both in (made, tensors))
    with cuda_kernels_on_cpu():
        expected, found = (fuse(which, config, lambda _: None) for which in (made, tensors))
    assert np.array_equal(found.vertices, expected.vertices)


def test_nothing_seen_is_nothing_and_no_gpu_is_one_sentence(without_gpu):
    view = views(1)[0]
    empty = replace(view, depth=np.zeros_like(view.depth))
    speck = empty.depth.copy()
    speck[1, 1] = 1.0  # beside the pixels that are followed
    for nothing in (empty, replace(view, depth=speck)):
        with cuda_kernels_on_cpu(), pytest.raises(InputError, match=r"no (pixel|surface)"):
            fuse([nothing], make_config(), lambda _: None)
    with pytest.raises(InputError, match=r"render\.device=cuda lacks"):
        fuse([view], make_config(), lambda _: None, "cuda")
