"""Smoothing takes roughness and nothing else: size, edges, rims, thin things, colours stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from room2dgs.mesh.clean import clean
from room2dgs.mesh.fuse import fuse
from room2dgs.mesh.smooth import smoothed
from tests.mesh.test_decimation import rim
from tests.mesh.test_tsdf import VOXEL, box_view, make_camera, make_config

STEPS = 5
CELL = 0.01


def rough(mesh: trimesh.Trimesh, size_m: float = 0.1 * CELL) -> trimesh.Trimesh:
    noise = np.random.default_rng(0).normal(0, size_m, mesh.vertices.shape)
    return clean(trimesh.Trimesh(mesh.vertices + noise, mesh.faces, process=False))


def ball(radius_m: float = 0.2) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=5, radius=radius_m)  # edges of about 7 mm


def cube(side: tuple[float, float, float]) -> trimesh.Trimesh:
    """Faces of a centimetre."""
    return trimesh.creation.box(side).subdivide_to_size(1.5 * CELL)


def test_roughness_goes_and_the_size_stays():
    before = rough(ball())
    after = smoothed(before, STEPS)
    off = [np.degrees(np.arccos(np.einsum("nc,nc->n", m.face_normals, trimesh.unitize(m.triangles_center))))
           for m in (before, after)]  # fmt: skip
    assert off[1].mean() < 0.5 * off[0].mean()
    distances = np.linalg.norm(after.vertices, axis=1) - 0.2
    assert abs(distances.mean()) < 0.1e-3
    assert distances.std() < 0.6e-3
    many = smoothed(before, 100)  # steps that only shrink would take a tenth of it
    assert many.volume == pytest.approx(before.volume, rel=0.02)


def test_a_rim_stays_to_the_last_bit_and_so_does_an_edge_of_three_faces():
    half = rough(trimesh.intersections.slice_mesh_plane(ball(), [0.3, 0.2, 1], [0, 0, 0.05]))
    after = smoothed(half, STEPS)
    np.testing.assert_array_equal(rim(after), rim(half))
    inside = ~np.isin(np.arange(len(half.vertices)), half.edges[trimesh.grouping.group_rows(half.edges_sorted, 1)])
    np.testing.assert_array_equal((after.vertices != half.vertices).any(axis=1), inside)
    corners = [[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [-1, 1, 0.5], [-1, -1, 0.4]]
    fan = trimesh.Trimesh(corners, [[0, 1, 2], [0, 1, 3], [1, 0, 4]], process=False)
    np.testing.assert_array_equal(smoothed(fan, STEPS).vertices, fan.vertices)


def test_a_corner_is_rounded_by_less_than_a_face_and_a_thin_board_keeps_its_thickness():
    box = cube((0.3, 0.2, 0.25))
    after = smoothed(box, STEPS)
    corners = np.linalg.norm(after.vertices - box.vertices, axis=1)
    assert corners.max() < 0.6 * CELL
    far = (np.sort(np.abs(np.abs(box.vertices) - box.extents / 2), axis=1)[:, 1]) > 4 * CELL
    assert far.sum() > 100
    assert np.abs(after.vertices - box.vertices)[far].max() < 0.3e-3  # the middles of the sides stay flat
    board = cube((0.3, 0.02, 0.25))
    thin = smoothed(board, STEPS)
    inner = (np.abs(board.vertices[:, [0, 2]]) < 0.09).all(axis=1)
    assert np.abs(np.abs(thin.vertices[inner, 1]) - 0.01).max() < 0.3e-3
    assert thin.volume == pytest.approx(board.volume, rel=0.05)


def test_faces_and_colours_are_the_meshs_own_and_the_mesh_is_left_alone():
    mesh = rough(ball())
    mesh.visual = trimesh.visual.ColorVisuals(
        mesh, vertex_colors=np.random.default_rng(1).integers(0, 256, (len(mesh.vertices), 3)).astype(np.uint8)
    )
    vertices = mesh.vertices.copy()
    after = smoothed(mesh, STEPS)
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(after.faces, mesh.faces)
    np.testing.assert_array_equal(after.visual.vertex_colors, mesh.visual.vertex_colors)
    assert (after.vertices != vertices).any(axis=1).all()
    again = smoothed(mesh, STEPS)
    np.testing.assert_array_equal(again.vertices, after.vertices)


def test_fusion_smooths_before_faces_become_few_and_none_is_none():
    rng = np.random.default_rng(2)
    views = [box_view(make_camera((0.1, 0.05, -0.1), turn)) for turn in range(0, 360, 30)]
    views = [replace(v, depth=(v.depth + rng.normal(0, 0.3 * VOXEL, v.depth.shape)).astype(np.float32)) for v in views]

    def made(**changes) -> trimesh.Trimesh:
        return fuse(views, make_config(flatten=False, **changes), lambda _: None)

    whole = made(smoothing_steps=0, max_error_m=None)
    smooth = made(smoothing_steps=STEPS, max_error_m=None)
    expected = clean(smoothed(whole, STEPS))
    np.testing.assert_array_equal(smooth.vertices, expected.vertices)
    np.testing.assert_array_equal(smooth.faces, expected.faces)
    few = [made(smoothing_steps=steps, max_error_m=0.005) for steps in (0, STEPS)]
    assert len(few[1].faces) < 0.9 * len(few[0].faces)
