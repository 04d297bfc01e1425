"""The mesh of everything: a room with a window, and a wall far behind it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.captures.cache import Cache
from room2dgs.config import load_config
from room2dgs.mesh import kept_views, voxel_table
from room2dgs.mesh.contracted import contracted, expanded
from room2dgs.mesh.fuse import fuse
from room2dgs.mesh.views import FusedView

FAR = 12.0  # metres, of the wall behind the window in the east side


@pytest.fixture(scope="module")
def mesh_config():
    settings = ["mesh=unbounded", "mesh.voxel_m=0.08", "mesh.min_weight=1", "mesh.max_error_m=null"]
    return load_config(["scene.path=a", "out=b", *settings]).mesh


def test_the_contraction_is_that_of_the_paper_and_goes_back():
    points = np.random.default_rng(0).normal(size=(500, 3)) * 8
    small = contracted(points, 3.0)
    unit = points / 3  # as the paper has it, about a unit ball
    length = np.linalg.norm(unit, axis=1, keepdims=True)
    np.testing.assert_allclose(small / 3, np.where(length < 1, unit, (2 - 1 / length) * unit / length), atol=1e-12)
    assert np.linalg.norm(small, axis=1).max() < 6
    np.testing.assert_allclose(expanded(small, 3.0), points, atol=1e-9)


def view(camera) -> FusedView:
    """Exact depth of a room of 4 x 3 x 2.5 m about the origin; behind a window in the east, a wall at x = FAR."""
    rays, eye = camera.world_rays(), camera.centre
    with np.errstate(divide="ignore"):
        sides = np.array([2.0, 1.5, 1.25])
        to_side = ((np.sign(rays) * sides - eye) / np.where(rays == 0, 1e-12, rays)).min(axis=-1)
    hit = eye + rays * to_side[..., None]
    window = (hit[..., 0] > 1.999) & (np.abs(hit[..., 1]) < 0.8) & (np.abs(hit[..., 2]) < 0.6)
    depth = np.where(window, (FAR - eye[0]) / np.where(window, rays[..., 0], 1), to_side)
    color = np.where(window[..., None], [200, 0, 0], [0, 0, 200]).astype(np.uint8)
    return FusedView(camera, depth.astype(np.float32), np.broadcast_to(color, (*depth.shape, 3)))


def test_what_lies_outside_the_room_is_meshed_too(make, mesh_config):
    cameras = [camera for place in ((0, 0, 0), (-0.5, 0.4, 0.1)) for camera in make.all_around(place)]
    views, said = [view(camera) for camera in cameras], []
    mesh = fuse((one for one in views), mesh_config, said.append)  # a generator: they are kept then
    x = mesh.vertices[:, 0]
    outside, inside = mesh.vertices[x > 6], mesh.vertices[x < 2.3]
    assert len(outside) > 200 and np.abs(np.median(outside[:, 0]) - FAR) < 0.1
    assert np.ptp(outside[:, 1]) > 5  # as wide as the window shows of it
    sides = np.abs(np.abs(inside) - [2.0, 1.5, 1.25]).min(axis=1)
    assert np.quantile(sides, 0.9) < 0.04
    red = np.asarray(mesh.visual.vertex_colors)[x > 6]
    assert (np.median(red, axis=0)[:3] == [200, 0, 0]).all()
    towards = np.einsum("ij,ij->i", mesh.face_normals, -mesh.triangles_center)  # the cameras are near the origin
    assert (towards > 0).mean() > 0.95  # but for the window's reveal
    near = fuse(views, replace(mesh_config, space="bounded", max_depth_m=8.0), said.append)
    assert near.vertices[:, 0].max() < 3


class Rendered:
    """Views that are made anew each time."""

    def __init__(self, cameras) -> None:
        self.cameras, self.made = cameras, 0

    def __iter__(self):
        for number, camera in enumerate(self.cameras):
            self.made += 1
            one = view(camera)
            yield one if number % 2 else replace(one, weight=np.full_like(one.depth, 0.5))


@pytest.mark.parametrize("budget_mb", [1500.0, 0.1])
def test_each_view_is_made_once_however_many_parts_the_table_has(make, mesh_config, monkeypatch, budget_mb):
    small = replace(mesh_config, voxel_m=0.2)
    cameras = make.all_around()
    whole = fuse(Rendered(cameras), small, print)
    monkeypatch.setattr(voxel_table, "ROWS", 8)
    monkeypatch.setattr(kept_views, "Cache", lambda: Cache(budget_mb))
    views = Rendered(cameras)
    mesh = fuse(views, small, print)
    assert views.made == len(cameras)
    assert np.array_equal(mesh.faces, whole.faces) and np.array_equal(mesh.vertices, whole.vertices)
    assert np.array_equal(mesh.visual.vertex_colors, whole.visual.vertex_colors)
