"""The expected error of a mesh's vertices: what views tell, how it is evened out, and what is cut away by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.config import load_config
from room2dgs.mesh.fuse import NoSurface, fuse
from room2dgs.mesh.io import read_mesh, write_mesh
from room2dgs.mesh.kept_views import KeptViews
from room2dgs.mesh.vertex_error import FACTOR, LEAST_M, UNTOLD_M, evened, sure_part, surest_view
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, VIEWS, with_nearest_error
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.world import mesh_in_world
from tests.mesh.test_gaps import grid
from tests.mesh.test_tsdf import make_camera, plane_view

TOWARDS, POINT = np.array([[0.0, 0, -1]]), np.array([[0.0, 0, 2]])


def view_of_wall(expected: float | None, depth: float = 2.0, centre=(0.0, 0.0, 0.0)) -> FusedView:
    """A wall at z = 2 m, square to the view; `depth` is what the view says of it."""
    view = plane_view(make_camera(centre), TOWARDS[0], -2.0)
    told = None if expected is None else np.full(view.depth.shape, expected, np.float32)
    return replace(view, depth=np.full(view.depth.shape, depth, np.float32), expected=told)


def test_a_place_is_as_sure_as_the_surest_view_that_shows_it():
    seen = surest_view(POINT, TOWARDS, [view_of_wall(0.02), view_of_wall(0.01, 2.04), view_of_wall(0.03)])
    assert seen == pytest.approx(0.01)
    assert surest_view(POINT, TOWARDS, [view_of_wall(0.02), view_of_wall(0.01, 2.06)]) == pytest.approx(0.02)
    for nothing in (
        [view_of_wall(0.0)],  # it does not say
        [view_of_wall(0.01, 0.0)],  # no depth
        [view_of_wall(0.01, centre=(0.0, 0.0, 3.0))],  # the wall is behind it
        [view_of_wall(0.01, centre=(9.0, 0.0, 0.0))],  # outside the picture
    ):
        assert np.isinf(surest_view(POINT, TOWARDS, nothing)).all()
    assert np.isinf(surest_view(POINT, -TOWARDS, [view_of_wall(0.01)])).all()  # its back
    assert surest_view(POINT, TOWARDS, [view_of_wall(None)]) is None


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 60.0])
def test_an_error_of_depth_counts_along_the_normal(tilt_deg):
    """On the axis, a surface turned by an angle moves along its normal by the cosine of what depth moves by."""
    angle = np.radians(tilt_deg)
    normal = np.array([[np.sin(angle), 0, -np.cos(angle)]])
    assert surest_view(POINT, normal, [view_of_wall(0.02)]) == pytest.approx(0.02 * np.cos(angle))


def test_off_the_axis_a_wall_moves_as_its_depth_does():
    point = np.array([[0.8, 0.3, 2.0]])
    assert surest_view(point, TOWARDS, [view_of_wall(0.02)]) == pytest.approx(0.02)


@given(st.floats(1e-4, 0.1), st.floats(1.1, 30.0))
def test_evening_out_keeps_a_constant_and_the_bounds(level, times):
    mesh = grid(6, 0.05)
    values = np.full(len(mesh.vertices), level)
    np.testing.assert_allclose(evened(values, mesh.faces), level, rtol=1e-9)
    values[24] *= times
    found = evened(values, mesh.faces)
    assert (found >= level * (1 - 1e-9)).all() and (found <= level * times * (1 + 1e-9)).all()
    assert found[24] <= values[24] and found.argmax() == 24


def test_a_vertex_of_no_face_keeps_its_own():
    mesh = grid(2, 0.05)
    found = evened(np.append(np.full(len(mesh.vertices), 0.01), 0.07), mesh.faces)
    np.testing.assert_allclose(found, [*[0.01] * len(mesh.vertices), 0.07], rtol=1e-9)


def config(**changes):
    return replace(load_config(["scene.path=a", "out=b"]).mesh, voxel_m=0.05, max_expected_m=0.3, **changes)


def test_a_fused_mesh_says_how_sure_it_is_where_views_do(tmp_path):
    mesh = fuse([view_of_wall(0.02), view_of_wall(0.04)], config(), lambda _: None)
    told = mesh.vertex_attributes[EXPECTED_ERROR]
    assert told.dtype == np.float32 and told.shape == (len(mesh.vertices),)
    inner = (np.abs(mesh.vertices[:, :2]) < (0.8, 0.5)).all(axis=1)
    np.testing.assert_allclose(told[inner], np.hypot(FACTOR * 0.02, LEAST_M), rtol=0.01)
    write_mesh(tmp_path / "mesh.ply", mesh_in_world(mesh, (1.0, 2.0, 3.0)))
    back = read_mesh(tmp_path / "mesh.ply")
    np.testing.assert_array_equal(back.vertex_attributes[EXPECTED_ERROR], told)
    fewer = trimesh.Trimesh(mesh.vertices[:50], [[0, 1, 2]], process=False)
    np.testing.assert_array_equal(with_nearest_error(fewer, mesh).vertex_attributes[EXPECTED_ERROR], told[:50])
    silent = fuse([view_of_wall(None)], config(), lambda _: None)
    assert EXPECTED_ERROR not in silent.vertex_attributes and VIEWS in silent.vertex_attributes


def test_what_is_not_sure_enough_is_cut_away_at_the_end():
    """A wall of which the left half is less sure."""
    view = view_of_wall(0.02)
    view.expected[:, :80] = 0.09
    said: list[str] = []
    whole = fuse([view], config(), said.append)
    assert not any("expected" in line for line in said)
    part = fuse([view], replace(config(), max_expected_m=0.08), said.append)
    assert whole.vertices[:, 0].min() < -1 and part.vertices[:, 0].min() > -0.4
    assert part.vertices[:, 0].max() == whole.vertices[:, 0].max()
    assert part.vertex_attributes[EXPECTED_ERROR].max() <= np.float32(0.08)
    assert len(part.vertex_attributes[VIEWS]) == len(part.vertices) == part.faces.max() + 1
    assert any("mesh.max_expected_m=0.08" in line for line in said)
    with pytest.raises(NoSurface, match=r"farther off than mesh\.max_expected_m=0\.01"):
        fuse([view], replace(config(), max_expected_m=0.01), said.append)
    assert sure_part(whole, replace(config(), max_expected_m=None), said.append) is whole


def test_what_no_view_shows_is_the_least_sure():
    behind = [replace(view_of_wall(0.02), depth=np.full((120, 160), 3.0, np.float32))]
    assert np.isinf(surest_view(POINT, TOWARDS, behind)).all()
    mesh = grid(4, 0.1)
    assert evened(np.minimum(np.full(len(mesh.vertices), np.inf), UNTOLD_M), mesh.faces).max() <= UNTOLD_M + 1e-12


def test_of_kept_views_the_depths_alone_stay_until_the_mesh_is_finished():
    views = [replace(view_of_wall(0.02), normal=np.zeros((120, 160, 3), np.float32)), view_of_wall(None)]
    kept = KeptViews(views)
    before = [view.depth for view in kept]
    whole = kept.in_memory
    kept.keep_depths()
    assert kept.in_memory == 4 * 120 * 160 * 3 < whole / 2  # two depths and one map of what is expected
    for _ in range(2):
        first, second = kept
        np.testing.assert_array_equal(first.depth, before[0])
        assert (first.expected == np.float32(0.02)).all() and second.expected is None and first.normal is None
    assert surest_view(POINT, TOWARDS, kept) == pytest.approx(0.02)
    kept.clear()
