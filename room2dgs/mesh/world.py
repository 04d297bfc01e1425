"""Mesh files lie in the capture's own world, and a run works in its scene's frame: `Scene.origin_m` is between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.mesh.io import read_mesh, write_mesh
from room2dgs.mesh.vertex_source import copied_source


def write_in_world(path: Path, mesh: trimesh.Trimesh, origin_m: Origin) -> None:
    """Write a mesh of the scene's frame, as `write_mesh`."""
    write_mesh(path, mesh_in_world(mesh, origin_m))


def read_in_scene(path: Path, origin_m: Origin) -> trimesh.Trimesh:
    """Read a mesh of the capture's world into the scene's frame, as `read_mesh`."""
    return mesh_in_scene(read_mesh(path), origin_m)


def mesh_in_world(mesh: trimesh.Trimesh, origin_m: Origin) -> trimesh.Trimesh:
    """A mesh of the scene's frame in the capture's world; the same object where that is the same."""
    return _shifted(mesh, np.array(origin_m))


def mesh_in_scene(mesh: trimesh.Trimesh, origin_m: Origin) -> trimesh.Trimesh:
    """The way back from `mesh_in_world`."""
    return _shifted(mesh, -np.array(origin_m))


def _shifted(mesh: trimesh.Trimesh, by: np.ndarray) -> trimesh.Trimesh:
    if tuple(by) == AT_ORIGIN:  # -0.0 is 0.0 too
        return mesh
    shifted = mesh.copy()
    shifted.vertices = np.asarray(mesh.vertices, np.float64) + by
    return copied_source(shifted, mesh)
