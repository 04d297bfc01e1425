"""Flat parts go to their planes, relief and curved parts stay."""

from __future__ import annotations

import numpy as np
import trimesh

from room2dgs.mesh.flat import NOISE_M, flattened


def noisy_box(noise_m: float) -> trimesh.Trimesh:
    box = trimesh.creation.box((2.0, 1.6, 1.2)).subdivide_to_size(0.04)
    box.merge_vertices()
    rng = np.random.default_rng(0)
    vertices = box.vertices + rng.normal(0, noise_m, box.vertices.shape)
    turned = trimesh.transformations.rotation_matrix(0.6, [1, 2, 3])[:3, :3]
    return trimesh.Trimesh(vertices @ turned.T, box.faces, process=False), turned


def test_walls_lose_their_noise_and_stay_where_they_are():
    mesh, turned = noisy_box(0.003)
    found = flattened(mesh)
    assert np.array_equal(found.faces, mesh.faces)
    for vertices, spread in ((mesh.vertices @ turned, (0.002, 0.004)), (found.vertices @ turned, (0.0, 0.0007))):
        for axis, half in enumerate((1.0, 0.8, 0.6)):
            others = np.delete(np.abs(vertices), axis, axis=1)
            inner = (others < np.delete([1.0, 0.8, 0.6], axis) - 0.15).all(axis=1)
            for side in (-1, 1):
                off = side * vertices[inner & (side * vertices[:, axis] > 0), axis] - half
                assert len(off) > 100
                assert spread[0] <= off.std() < spread[1] and abs(off.mean()) < 0.001


def test_relief_and_round_things_stay():
    mesh, turned = noisy_box(0.0)
    place = mesh.vertices @ turned
    raised = (place[:, 0] > 0.99) & (np.abs(place[:, 1:]) < 0.1).all(axis=1)
    place[raised, 0] += 3 * NOISE_M
    found = flattened(trimesh.Trimesh(place, mesh.faces, process=False))
    assert raised.sum() > 10 and np.abs(found.vertices[raised, 0] - place[raised, 0]).max() < 1e-9
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    assert np.array_equal(flattened(ball).vertices, ball.vertices)
