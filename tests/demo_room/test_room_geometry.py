"""Patches and solids: closed, facing outwards, and unchanged by refinement."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.demo_room.atlas import lookup, pack
from room2dgs.demo_room.geometry import (
    Material,
    box,
    curtain,
    cylinder,
    parallelogram,
    placed,
    sphere,
    triangulated,
)
from room2dgs.demo_room.layout import room_patches
from room2dgs.demo_room.mesh import MAX_EDGE
from room2dgs.demo_room.textures import TEXTURES, texture

PAINT = Material("paint", ((0.5, 0.5, 0.5),))


def solid(patches) -> trimesh.Trimesh:
    """The triangles of patches as one mesh."""
    soup = triangulated(patches)
    return trimesh.Trimesh(soup.vertices.astype(float), soup.triangles.astype(int), process=False)


def test_normals_of_solids_point_outwards():
    assert solid(box((1, 2, 3), (2, 4, 6), PAINT)).volume == pytest.approx(6.0)
    assert solid(cylinder((1, 1, 1), 0.3, 0.5, PAINT)).volume == pytest.approx(np.pi * 0.09 * 0.5, rel=0.02)
    cone = np.pi * 0.6 * (0.3**2 + 0.3 * 0.1 + 0.1**2) / 3
    assert solid(cylinder((0, 0, 0), 0.3, 0.6, PAINT, top_radius=0.1)).volume == pytest.approx(cone, rel=0.02)
    assert solid([sphere((1, 1, 1), 0.4, PAINT, squash=0.5)]).volume == pytest.approx(np.pi * 0.4**3 * 2 / 3, rel=0.02)


def test_the_walls_face_the_room():
    shell = [p for p in room_patches(0, 0) if p.tag in ("floor", "ceiling") or p.tag.startswith("wall")]
    assert len(shell) == 6
    assert solid(shell).volume == pytest.approx(-4.5 * 3.5 * 2.6, rel=1e-6)


@settings(max_examples=20, deadline=None)
@given(yaw=st.floats(-4, 4), edge=st.floats(0.02, 0.2), radius=st.floats(0.05, 0.4))
def test_refinement_stays_on_the_surface(yaw, edge, radius):
    pieces = [
        *box((0, 0, 0), (0.4, 0.3, 0.2), PAINT),
        *cylinder((1, 0, 0), radius, 0.4, PAINT, "", 0.7 * radius),
    ]
    pieces.append(curtain(0.4, 0.5, 0.02, 3, PAINT))
    pieces = placed(pieces, (1.0, 2.0, 0.0), yaw)
    fine = [piece.refined(edge) for piece in pieces]
    assert solid(fine).area == pytest.approx(solid(pieces).area, rel=1e-5)
    assert max(np.linalg.norm(np.diff(p.grid, axis=k), axis=-1).max() for p in fine for k in (0, 1)) <= edge + 1e-9


def test_spheres_are_fine_enough_to_be_left_alone():
    for patch in room_patches(1, 0):
        if patch.tag in ("pouf", "globe", "fruit"):
            assert patch.refined(MAX_EDGE).grid.shape == patch.grid.shape or patch.grid.shape[0] <= 2


@pytest.mark.parametrize("kind", sorted(TEXTURES))
@pytest.mark.parametrize("size", [(0.002, 0.002), (0.9, 0.004), (0.004, 0.9), (0.31, 0.17)])
def test_textures_fit_any_size(kind, size):
    colors = tuple((0.2 + 0.1 * k, 0.5, 0.7 - 0.1 * k) for k in range(6))
    image = texture(Material(kind, colors), size, 0.003, np.random.default_rng(0))
    assert image.shape == (max(2, round(size[1] / 0.003)), max(2, round(size[0] / 0.003)), 3)
    if kind not in ("paint", "emitter") and min(size) > 0.1:
        assert image.std(axis=(0, 1)).max() > 3


def test_lookups_never_leave_their_chart():
    patches = [parallelogram((0, 0, 0), (w, 0, 0), (0, h, 0), PAINT) for w, h in ((0.5, 0.3), (0.01, 0.4), (0.2, 0.2))]
    charts = pack(patches, 0.01, 64)
    atlas = np.full((*charts.shape, 3), 255, np.uint8)
    for number, ((x, y), (w, h)) in enumerate(zip(charts.corner, charts.size, strict=True)):
        assert np.all(atlas[y : y + h, x : x + w] == 255)  # charts do not overlap
        atlas[y : y + h, x : x + w] = number
    corners = np.array([(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5)], np.float32)
    for number in range(3):
        values = lookup(atlas, charts.texels(np.full(5, number), corners))
        np.testing.assert_array_equal(values, number)
