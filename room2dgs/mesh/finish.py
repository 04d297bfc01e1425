"""What every raw surface goes through: cleaned, smoothed, filled, and as few faces as will do."""

from __future__ import annotations

import numpy as np
import trimesh

from room2dgs.config import MeshConfig
from room2dgs.errors import InputError
from room2dgs.freed_memory import give_back
from room2dgs.logs import Log
from room2dgs.mesh.area import area_m2
from room2dgs.mesh.checks import check_mesh
from room2dgs.mesh.clean import clean
from room2dgs.mesh.edges import is_closed
from room2dgs.mesh.voxel import voxel_side


class NoSurface(InputError):
    """Depth maps or points make no surface under these settings."""


def cleaned(raw: trimesh.Trimesh, config: MeshConfig, log: Log) -> trimesh.Trimesh:
    """Without small pieces, in an order that does not depend on the raw one's.

    Args:
        raw: with faces.
        config: `voxel_m` is a number (`voxel.with_voxel`).

    Raises:
        NoSurface: all pieces are small.
    """
    mesh = clean(raw, config.min_triangles, config.keep_clusters)
    if not len(mesh.faces):
        raise NoSurface(
            f"every piece of the mesh has fewer than mesh.min_triangles={config.min_triangles} faces; lower it"
        )
    log(
        f"mesh: {len(mesh.faces):,} faces, {len(raw.faces) - len(mesh.faces):,} dropped by cleaning "
        f"(voxels of {100 * voxel_side(config):g} cm)"
    )
    return mesh


def finished(mesh: trimesh.Trimesh, config: MeshConfig, log: Log) -> trimesh.Trimesh:
    """Smoothed, filled and with few faces, as the settings ask for.

    Args:
        mesh: cleaned (`cleaned`).

    Raises:
        TypeError, ValueError: no mesh, or one of faces or vertices that cannot be.
    """
    check_mesh(mesh)
    give_back()  # what was cleaned away
    mesh = _smooth(mesh, config)
    give_back()
    mesh = _flat(mesh, config)
    give_back()
    # rims stay as they are when faces are dropped, and then far fewer are to be looked at for holes
    for step in (_few, _filled) if config.fill == "holes" else (_filled, _few):
        mesh = step(mesh, config, log)
        give_back()
    return mesh


def _smooth(mesh: trimesh.Trimesh, config: MeshConfig) -> trimesh.Trimesh:
    from room2dgs.mesh.smooth import smoothed

    return clean(smoothed(mesh, config.smoothing_steps)) if config.smoothing_steps else mesh


def _flat(mesh: trimesh.Trimesh, config: MeshConfig) -> trimesh.Trimesh:
    from room2dgs.mesh.flat import flattened

    return clean(flattened(mesh)) if config.flatten else mesh


def _filled(mesh: trimesh.Trimesh, config: MeshConfig, log: Log) -> trimesh.Trimesh:
    from room2dgs.mesh.fill import holes_filled, watertight

    if config.fill == "none" or (config.fill == "holes" and not config.inferred):
        return mesh
    if config.fill == "holes":
        filled = clean(holes_filled(mesh, config.fill_hole_m))
    else:
        filled = watertight(mesh, voxel_side(config))  # cleaning would tear it open where it was pressed flat
    before, after = ((np.asarray(one.vertices), np.asarray(one.faces)) for one in (mesh, filled))
    added = max(area_m2(*after) - area_m2(*before), 0.0)  # of the same faces in another order it may be -1e-15
    closed = ", closed" if _closed(filled) else ", not closed everywhere" if config.fill == "watertight" else ""
    log(f"mesh: mesh.fill={config.fill} added {added:.2f} m2, {len(filled.faces):,} faces{closed}")
    return filled


def _few(mesh: trimesh.Trimesh, config: MeshConfig, log: Log) -> trimesh.Trimesh:
    from room2dgs.mesh.decimation import decimation

    if config.max_error_m is None:
        return mesh
    found = decimation(mesh, config.max_error_m)
    if config.fill == "watertight" and _closed(mesh) and not _closed(found.mesh):
        log("mesh: all faces stay: with fewer it would not be closed (mesh.fill=watertight)")
        return mesh
    if found.mesh is not mesh:
        log(f"mesh: {len(found.mesh.faces):,} faces are enough (mesh.max_error_m): {found.sentence}")
    return found.mesh


def _closed(mesh: trimesh.Trimesh) -> bool:
    return is_closed(np.asarray(mesh.faces), len(mesh.vertices))
