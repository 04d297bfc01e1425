"""`mesh.fill` in fusion: what comes out is what was asked for, and the log says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from room2dgs.config import load_config
from room2dgs.mesh import fuse as fusion
from room2dgs.mesh.clean import clean
from room2dgs.mesh.edges import is_closed
from room2dgs.mesh.finish import finished
from room2dgs.mesh.whole_surface import Raw


@pytest.mark.parametrize(("fill", "closed"), [("none", False), ("holes", True), ("watertight", True)])
def test_a_hole_is_closed_if_asked_for(monkeypatch, fill, closed):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    torn = trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 2] < 0.99][:, ::-1], process=False)
    torn.visual = trimesh.visual.ColorVisuals(torn, vertex_colors=np.full((len(torn.vertices), 3), 90, np.uint8))
    monkeypatch.setattr(fusion, "whole_surface", lambda views, config: Raw(torn))
    config = replace(load_config(["scene.path=a", "out=b"]).mesh, fill=fill, fill_hole_m=0.6, voxel_m=0.05)
    said: list[str] = []
    mesh = fusion.fuse([], config, said.append)
    assert mesh.is_watertight is closed
    assert any(f"mesh.fill={fill}" in line for line in said) is closed
    assert mesh.volume == pytest.approx(-4 / 3 * np.pi, rel=0.03)
    assert (np.asarray(mesh.visual.vertex_colors)[:, 0] == 90).all()


def test_by_default_cracks_are_closed_and_what_nobody_saw_stays_open(monkeypatch):
    ball = trimesh.creation.icosphere(subdivisions=6, radius=1.0)
    x, y, z = ball.triangles_center.T
    crack, unseen = (z > 0) & (np.hypot(x, y) < 0.025), (z < 0) & (np.hypot(x, y) < 0.2)
    torn = trimesh.Trimesh(ball.vertices, ball.faces[~crack & ~unseen][:, ::-1], process=False)
    monkeypatch.setattr(fusion, "whole_surface", lambda views, config: Raw(torn))
    said: list[str] = []
    mesh = fusion.fuse([], replace(load_config(["scene.path=a", "out=b"]).mesh, voxel_m=0.05), said.append)
    # of few faces: all of them would take much more memory
    assert ["are enough" in line for line in said[-2:]] == [True, False] and "mesh.fill=holes" in said[-1]
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    rims = mesh.vertices[edges[count == 1]]
    assert crack.any() and len(rims) and (rims[..., 2] < 0).all()
    assert np.hypot(rims[..., 0], rims[..., 1]).max() < 0.25


def test_a_room_without_ceiling_stays_closed_whatever_max_error_m_asks_for():
    """What is pressed flat above has faces without area, which fewer faces would tear open."""
    rng = np.random.default_rng(0)
    room = trimesh.creation.box((4.0, 3.0, 2.4)).subdivide_to_size(0.1)
    middles = room.triangles_center
    seen = (middles[:, 2] < 1.19) & ~((middles[:, 0] > 1.99) & (np.abs(middles[:, 1]) < 0.5))
    open_room = trimesh.Trimesh(room.vertices, room.faces[seen][:, ::-1], process=False)
    open_room = clean(open_room)
    open_room.vertices = np.asarray(open_room.vertices) + rng.normal(0, 0.006, open_room.vertices.shape)
    said: list[str] = []
    config = replace(load_config(["scene.path=a", "out=b"]).mesh, fill="watertight", voxel_m=0.05, smoothing_steps=0)
    mesh = finished(open_room, config, said.append)
    assert any("faces, closed" in line for line in said)
    assert is_closed(np.asarray(mesh.faces), len(mesh.vertices))
