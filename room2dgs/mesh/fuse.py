"""Depth maps in, a cleaned coloured mesh out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import trimesh

from room2dgs.config import MeshConfig
from room2dgs.freed_memory import give_back
from room2dgs.kernels.builds import CPU, build_of
from room2dgs.logs import Log
from room2dgs.mesh.clean import clean
from room2dgs.mesh.finish import NoSurface, cleaned, finished
from room2dgs.mesh.gaps import narrow_gaps
from room2dgs.mesh.kept_views import KeptViews
from room2dgs.mesh.vertex_colors import vertex_colors
from room2dgs.mesh.vertex_error import sure_part, with_expected_error
from room2dgs.mesh.vertex_source import with_source
from room2dgs.mesh.views import FusedView
from room2dgs.mesh.whole_surface import GAP_M, Raw, whole_surface


def fuse(views: Iterable[FusedView], config: MeshConfig, log: Log, device: str = "cpu") -> trimesh.Trimesh:
    """Fuse, mesh, clean and smooth; the views are made once, and kept meanwhile (`KeptViews`).

    Args:
        config: `voxel_m` is a number (`voxel.with_voxel`).
        device: `render.device`: what fuses. Marching cubes, cleaning and mesh.space=contracted are the CPU's.

    Returns:
        Coloured mesh in the world frame, metres, faces towards the cameras; the same on any number of threads. Its
        vertices say how far off they are expected to be (`vertex_error`), and what they rest on (`vertex_source`) but
        for mesh.space=contracted.

    Raises:
        NoSurface: no surface is left; names the settings to relax.
        InputError: no GPU where one is asked for.
    """
    watched = _Watched(views, config)
    kept = KeptViews(watched)
    try:
        mesh = with_expected_error(_made(kept, watched, config, log, device), kept)
    finally:
        kept.clear()
    mesh = sure_part(mesh, config, log)
    if not len(mesh.faces):
        raise NoSurface(
            "all of the mesh is expected to be farther off than "
            f"mesh.max_expected_m={config.max_expected_m:g}; raise it, or film the room from more places"
        )
    return mesh


def _made(views: KeptViews, watched: _Watched, config: MeshConfig, log: Log, device: str) -> trimesh.Trimesh:
    # no mesh has a name here for longer than it must: a room's is hundreds of megabytes, at each of these steps
    mesh, seen = _raw(views, watched, config, device)
    views.keep_depths()
    mesh = clean(mesh)  # vertices that were meshed twice are one
    if seen is None:
        return finished(cleaned(mesh, config, log), config, log)
    raw, least = np.asarray(mesh.vertices), max(config.min_weight, 1.0)
    views_of = seen.at(raw)
    mesh = cleaned(_whole(mesh, views_of >= least, config), config, log)
    return with_source(finished(mesh, config, log), raw, views_of, least)


def _raw(views: KeptViews, watched: _Watched, config: MeshConfig, device: str) -> Raw:
    raw = _integrated(views, config, device)
    give_back()  # the volume
    if not len(raw.mesh.faces):
        raise NoSurface(_why_none(config) if watched.any_pixel else _why_no_pixel(config))
    return raw


def _integrated(views: Iterable[FusedView], config: MeshConfig, device: str) -> Raw:
    if config.space == "contracted":
        from room2dgs.mesh.contracted import integrate_contracted

        return Raw(integrate_contracted(views, config))
    if build_of(device) is not CPU:
        from room2dgs.mesh.device_volume import integrate_on_device

        return integrate_on_device(views, config, device)
    return whole_surface(views, config)


def _whole(mesh: trimesh.Trimesh, measured: np.ndarray, config: MeshConfig) -> trimesh.Trimesh:
    """The measured part, with narrow gaps in it closed if they are to be."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    stays = narrow_gaps(vertices, faces, measured, GAP_M) if config.inferred else measured
    return trimesh.Trimesh(vertices, faces[stays[faces].all(axis=1)], vertex_colors=vertex_colors(mesh), process=False)


class _Watched:
    """The views as they come.

    Attributes:
        any_pixel: whether one of them had a depth that may be fused.
    """

    def __init__(self, views: Iterable[FusedView], config: MeshConfig) -> None:
        self._views = views
        self._farthest = config.max_depth_m
        self.any_pixel = False

    def __iter__(self) -> Iterator[FusedView]:
        for view in self._views:
            if not self.any_pixel:
                usable = (view.depth > 0) & (view.depth <= self._farthest)
                self.any_pixel = bool((usable if view.weight is None else usable & (view.weight > 0)).any())
            yield view


def _why_no_pixel(config: MeshConfig) -> str:
    helps = [f"raise mesh.max_depth_m={config.max_depth_m:g}"]
    if config.source == "surfels":
        helps = ["train longer", *helps]
        if config.min_alpha > 0:
            helps.append(f"lower mesh.min_alpha={config.min_alpha:g}")
        if config.max_angle_deg < 90:
            helps.append(f"raise mesh.max_angle_deg={config.max_angle_deg:g}")
    else:
        helps = ["add photos that overlap", *helps]
    if config.source in ("surfels", "depth") and config.max_expected_m is not None:
        helps.append(f"raise mesh.max_expected_m={config.max_expected_m:g}")
    return f"no pixel of the depth maps may be fused; {_either(helps)}"


def _why_none(config: MeshConfig) -> str:
    helps = ["train longer" if config.source == "surfels" else "add photos of the same places"]
    if config.min_weight > 1:  # one view is the least that a voxel can be seen by
        helps.append(f"lower mesh.min_weight={config.min_weight:g}")
    helps.append(f"take larger voxels than mesh.voxel_m={config.voxel_m:g}")
    return f"no surface came out of the depth maps; {_either(helps)}"


def _either(parts: list[str]) -> str:
    return f"{', '.join(parts[:-1])} or {parts[-1]}"
