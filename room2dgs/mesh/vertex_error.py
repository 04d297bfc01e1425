"""How far off each vertex of a mesh is expected to be: one standard deviation along its normal, metres.

A place is as sure as the surest view that shows it: errors of views of one place come from the same causes, so that
more of them add nothing (`bench calibration`). One pixel's expected error is rough itself; neighbours on the surface
even it out. To be right in size, what is left is multiplied, and no place is surer than `LEAST_M`.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import trimesh
from scipy.sparse import coo_matrix

from room2dgs.config import MeshConfig
from room2dgs.logs import Log
from room2dgs.mesh.area import area_m2
from room2dgs.mesh.edges import edges_and_faces
from room2dgs.mesh.vertex_colors import vertex_colors
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, NAMES, told_by
from room2dgs.mesh.views import FusedView

# chosen by `bench calibration` on made rooms and greywhite: two standard deviations hold 92 % of each
FACTOR, LEAST_M = 1.4, 0.003
UNTOLD_M = 0.1  # by the views, at most: where none shows the surface, or says how sure it is
SHOWN_M = 0.05  # a view whose depth is farther off shows something else
FACING = 0.1  # cosine between the normal and the direction to the camera, at least
STEPS, FLOOR_M = 10, 0.001  # of evening out along edges; metres beside which a difference does not count


def with_expected_error(mesh: trimesh.Trimesh, views: Iterable[FusedView]) -> trimesh.Trimesh:
    """The mesh with `EXPECTED_ERROR` as a vertex attribute, float32; without it if no view says how sure it is.

    Args:
        mesh: scene's frame; faces wind counter-clockwise seen from the cameras.
        views: those that were fused.
    """
    vertices, normals = np.asarray(mesh.vertices), np.asarray(mesh.vertex_normals)
    surest = surest_view(vertices, normals, views)
    if surest is not None:
        even = evened(np.minimum(surest, UNTOLD_M), np.asarray(mesh.faces))
        mesh.vertex_attributes[EXPECTED_ERROR] = np.hypot(FACTOR * even, LEAST_M).astype(np.float32)
    return mesh


def surest_view(points: np.ndarray, normals: np.ndarray, views: Iterable[FusedView]) -> np.ndarray | None:
    """(N,) metres along the normals: the least error that a view expects which shows the point, inf where none does.

    None: no view says what it expects.

    Args:
        points, normals: (N, 3); unit normals, towards the cameras.
    """
    surest, told = np.full(len(points), np.inf), False
    for view in views:
        if view.expected is None:
            continue
        told = True
        there = view.on_cpu()
        assert there.expected is not None
        place, column, row, z = there.camera.pixels_of(points)
        depth, expected = (np.asarray(part)[row, column].astype(np.float64) for part in (there.depth, there.expected))
        # what a metre of depth is along the normal
        along = ((there.camera.centre - points[place]) * normals[place]).sum(axis=1) / z
        distance = np.linalg.norm(there.camera.centre - points[place], axis=1) / z
        shown = (depth > 0) & (expected > 0) & (np.abs(depth - z) < SHOWN_M) & (along > FACING * distance)
        surest[place[shown]] = np.minimum(surest[place[shown]], (expected * along)[shown])
    return surest if told else None


def evened(values: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V,) values of vertices, each with a part of its neighbours', as products: in steps along edges."""
    edges, _ = edges_and_faces(faces, len(values))
    one, other = np.concatenate([edges, edges[:, ::-1]]).T
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(values), len(values))).tocsr()
    count = np.asarray(graph.sum(axis=1)).ravel()
    found = np.log(values + FLOOR_M)
    for _ in range(STEPS):
        around = np.divide(graph @ found, count, out=found.copy(), where=count > 0)
        found = (found + around) / 2
    return np.exp(found) - FLOOR_M


def sure_part(mesh: trimesh.Trimesh, config: MeshConfig, log: Log) -> trimesh.Trimesh:
    """Without faces that have a corner which is expected to be more than `mesh.max_expected_m` off.

    Returns:
        The mesh itself where all of it is sure enough; possibly without faces.
    """
    expected = told_by(mesh, EXPECTED_ERROR)
    if config.max_expected_m is None or expected is None:
        return mesh
    sure = expected <= config.max_expected_m
    if sure.all():
        return mesh
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    kept = faces[sure[faces].all(axis=1)]
    used = np.zeros(len(vertices), bool)
    used[kept] = True
    colors = vertex_colors(mesh)
    found = trimesh.Trimesh(
        vertices[used],
        (np.cumsum(used) - 1)[kept],
        vertex_colors=None if colors is None else colors[used],
        process=False,
    )
    for name in NAMES:
        if (values := told_by(mesh, name)) is not None:
            found.vertex_attributes[name] = values[used]
    gone = area_m2(vertices, faces) - area_m2(vertices, kept)
    log(f"mesh: {gone:.2f} m2 are expected to be more than mesh.max_expected_m={config.max_expected_m:g} off and go")
    return found
