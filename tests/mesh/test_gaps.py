"""Gaps: blocks and surface between measured parts, and which vertices are measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from room2dgs.config import load_config
from room2dgs.geometry.cells import keys_of
from room2dgs.mesh.closing import closed
from room2dgs.mesh.fuse import fuse
from room2dgs.mesh.gaps import narrow_gaps
from room2dgs.mesh.io import read_mesh, write_mesh
from room2dgs.mesh.vertex_source import SOURCE, VIEWS
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.voxel_table import block_coordinates
from tests.mesh.test_tsdf import make_camera, plane_view


def sheet(side: int) -> np.ndarray:
    """(N, 2) x and y of a square of blocks."""
    return np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize(("wide", "steps", "closes"), [(2, 1, True), (3, 1, False), (4, 2, True), (5, 2, False)])
def test_blocks_close_gaps_of_twice_their_steps_and_grow_nowhere_else(wide, steps, closes):
    xy = sheet(16)
    hole = ((xy >= 6) & (xy < 6 + wide)).all(axis=1)
    blocks = np.concatenate([xy, np.zeros((len(xy), 1), int)], axis=1)
    found = {*map(tuple, block_coordinates(closed(np.sort(keys_of(blocks[~hole])), steps)))}
    given, gap = ({*map(tuple, blocks[which])} for which in (~hole, hole))
    assert given <= found
    assert gap <= found if closes else not gap <= found
    assert all(z == 0 and 0 <= x < 16 and 0 <= y < 16 for x, y, z in found)


def grid(count: int, side: float) -> trimesh.Trimesh:
    at = np.arange(count + 1)
    x, y = np.meshgrid(at, at, indexing="ij")
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3) * side
    number = np.arange((count + 1) ** 2).reshape(count + 1, -1)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return trimesh.Trimesh(vertices, faces, process=False)


def test_a_narrow_gap_stays_a_wide_one_and_what_hangs_over_go():
    mesh = grid(100, 0.01)
    x, y, _ = mesh.vertices.T
    narrow = np.hypot(x - 0.25, y - 0.5) < 0.06
    wide = np.hypot(x - 0.6, y - 0.5) < 0.2
    over = x > 0.9
    stays = narrow_gaps(mesh.vertices, mesh.faces, ~(narrow | wide | over), 0.2)
    assert stays[~(narrow | wide | over)].all() and stays[narrow].all()
    assert not stays[np.hypot(x - 0.6, y - 0.5) < 0.1].any()
    assert not stays[x > 0.93].any()


def holed_views() -> list[FusedView]:
    """A wall at 1.5 m; nobody sees a disc of 12 cm."""
    views = []
    for at in (-0.1, 0.0, 0.1):
        view = plane_view(make_camera((at, 0.03, 0.0)), np.array([0.0, 0, -1]), -1.5)
        points = view.camera.centre + view.camera.world_rays() * view.depth[..., None]
        depth = np.where(np.hypot(points[..., 0], points[..., 1]) < 0.06, 0, view.depth).astype(np.float32)
        views.append(replace(view, depth=depth))
    return views


def settings(**changes):
    mesh = load_config(["scene.path=x", "out=y"]).mesh
    return replace(mesh, **{"voxel_m": 0.02, "max_error_m": None, **changes})


def test_vertices_say_whether_they_are_measured_and_by_how_many_views(tmp_path):
    mesh = fuse(holed_views(), settings(), lambda _: None)
    away = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    inferred = mesh.vertex_attributes[SOURCE] == 1
    assert inferred[away < 0.04].all() and (away < 0.04).sum() > 10
    assert not inferred[(away > 0.09) & (away < 0.4)].any()
    assert (mesh.vertex_attributes[VIEWS][(away > 0.09) & (away < 0.3)] == 3).all()
    assert np.abs(mesh.vertices[away < 0.3, 2] - 1.5).max() < 0.005
    write_mesh(tmp_path / "mesh.ply", mesh)
    again = read_mesh(tmp_path / "mesh.ply")
    for name in (SOURCE, VIEWS):
        assert np.array_equal(again.vertex_attributes[name], mesh.vertex_attributes[name])


def test_inferred_false_leaves_the_hole():
    mesh = fuse(holed_views(), settings(inferred=False), lambda _: None)
    away = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    assert (mesh.vertex_attributes[SOURCE] == 0).all() and away.min() > 0.03


def test_a_view_that_looks_through_a_wrong_surface_says_so():
    """One view has a wall 40 cm before the one that three others see."""
    wall = [plane_view(make_camera((x, 0.0, 0.0)), np.array([0.0, 0, -1]), -1.5) for x in (-0.1, 0.0, 0.1)]
    wrong = plane_view(make_camera(), np.array([0.0, 0, -1]), -1.1)
    mesh = fuse([wrong, *wall], settings(), lambda _: None)
    inner = mesh.vertices[np.abs(mesh.vertices[:, :2]).max(axis=1) < 0.3]
    assert len(inner) > 500 and inner[:, 2].min() > 1.45
