"""Depth maps in, a cleaned coloured mesh out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import trimesh

from room2dgs.config import MeshConfig
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.mesh.clean import clean
from room2dgs.mesh.tsdf import integrate
from room2dgs.mesh.views import FusedView


def fuse(views: Iterable[FusedView], config: MeshConfig, log: Log, device: str = "cpu") -> trimesh.Trimesh:
    """Fuse, mesh, clean and smooth; the views are taken one at a time and not kept.

    With mesh.space=contracted they are taken several times, and kept if `views` can be taken only once.

    Args:
        device: `render.device`: what fuses. Marching cubes, cleaning and mesh.space=contracted are the CPU's.

    Returns:
        Coloured mesh in the world frame, metres, faces towards the cameras; the same on any number of threads.

    Raises:
        InputError: no surface is left; names the settings to relax. No GPU where one is asked for.
    """
    raw = _integrated(views, config, device)
    if not len(raw.faces):
        raise InputError(
            "no surface came out of the depth maps; train longer, or lower mesh.min_weight or mesh.min_alpha"
        )
    mesh = clean(raw, config.min_triangles, config.keep_clusters)
    if not len(mesh.faces):
        raise InputError(
            f"every piece of the mesh has fewer than mesh.min_triangles={config.min_triangles} faces; lower it"
        )
    log(f"mesh: {len(mesh.faces):,} faces, {len(raw.faces) - len(mesh.faces):,} dropped by cleaning")
    return _few(_filled(_smooth(mesh, config), config, log), config, log)


def _integrated(views: Iterable[FusedView], config: MeshConfig, device: str) -> trimesh.Trimesh:
    if config.space == "bounded" and device != "cpu":
        from room2dgs.mesh.device_volume import integrate_on_device

        return integrate_on_device(views, config, device)
    if config.space == "bounded":
        return integrate(views, config)
    from room2dgs.mesh.contracted import integrate_contracted

    return integrate_contracted(_OnCpu(list(views) if iter(views) is views else views), config)


class _OnCpu:
    """The views in the CPU's memory, each time that they are gone through."""

    def __init__(self, views: Iterable[FusedView]) -> None:
        self._views = views

    def __iter__(self) -> Iterator[FusedView]:
        return (view.on_cpu() for view in self._views)


def _smooth(mesh: trimesh.Trimesh, config: MeshConfig) -> trimesh.Trimesh:
    from room2dgs.mesh.smooth import smoothed

    return clean(smoothed(mesh, config.smoothing_steps)) if config.smoothing_steps else mesh


def _filled(mesh: trimesh.Trimesh, config: MeshConfig, log: Log) -> trimesh.Trimesh:
    from room2dgs.mesh.fill import holes_filled, watertight

    if config.fill == "none":
        return mesh
    if config.fill == "holes":
        filled = clean(holes_filled(mesh, config.fill_hole_m))
    else:
        filled = watertight(mesh, config.voxel_m)  # cleaning would tear it open where it was pressed flat
    added = filled.area - mesh.area
    closed = ", closed" if filled.is_watertight else ", not closed everywhere" if config.fill == "watertight" else ""
    log(f"mesh: mesh.fill={config.fill} added {added:.2f} m2, {len(filled.faces):,} faces{closed}")
    return filled


def _few(mesh: trimesh.Trimesh, config: MeshConfig, log: Log) -> trimesh.Trimesh:
    from room2dgs.mesh.few_faces import few_faces

    if config.max_error_m is None:
        return mesh
    found = few_faces(mesh, config.max_error_m)
    if found.mesh is not mesh:
        log(f"mesh: {len(found.mesh.faces):,} faces are enough (mesh.max_error_m): {found.sentence}")
    return found.mesh
