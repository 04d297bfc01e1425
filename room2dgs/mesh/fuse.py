"""Depth maps in, a cleaned coloured mesh out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import trimesh

from room2dgs.captures.cache import Cache
from room2dgs.config import MeshConfig
from room2dgs.freed_memory import give_back
from room2dgs.geometry.camera import Camera
from room2dgs.kernels.builds import CPU, build_of
from room2dgs.logs import Log
from room2dgs.mesh.finish import NoSurface, cleaned, finished
from room2dgs.mesh.tsdf import integrate
from room2dgs.mesh.views import FusedView


def fuse(views: Iterable[FusedView], config: MeshConfig, log: Log, device: str = "cpu") -> trimesh.Trimesh:
    """Fuse, mesh, clean and smooth; the views are taken once, one at a time, and not kept.

    With mesh.space=contracted, which needs them several times, they are kept meanwhile (`_Kept`).

    Args:
        config: `voxel_m` is a number (`voxel.with_voxel`).
        device: `render.device`: what fuses. Marching cubes, cleaning and mesh.space=contracted are the CPU's.

    Returns:
        Coloured mesh in the world frame, metres, faces towards the cameras; the same on any number of threads.

    Raises:
        NoSurface: no surface is left; names the settings to relax.
        InputError: no GPU where one is asked for.
    """
    # no mesh has a name here: a room's is hundreds of megabytes, at each of these steps
    return finished(cleaned(_raw(views, config, device), config, log), config, log)


def _raw(views: Iterable[FusedView], config: MeshConfig, device: str) -> trimesh.Trimesh:
    watched = _Watched(views, config)
    raw = _integrated(watched, config, device)
    give_back()  # the volume
    if not len(raw.faces):
        raise NoSurface(_why_none(config) if watched.any_pixel else _why_no_pixel(config))
    return raw


def _integrated(views: Iterable[FusedView], config: MeshConfig, device: str) -> trimesh.Trimesh:
    if config.space == "bounded" and build_of(device) is not CPU:
        from room2dgs.mesh.device_volume import integrate_on_device

        return integrate_on_device(views, config, device)
    if config.space == "bounded":
        return integrate(views, config)
    from room2dgs.mesh.contracted import integrate_contracted

    kept = _Kept(views)
    try:
        return integrate_contracted(kept, config)
    finally:
        kept.clear()


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


class _Kept:
    """The views in the CPU's memory as often as they are gone through, though they are made once: rendering takes
    longer than reading. What has no room lies on the disk. Without their normals, which nobody asks for here.
    """

    def __init__(self, views: Iterable[FusedView]) -> None:
        self._views = views
        self._cameras: list[Camera] = []
        self._whole = False
        self._cache = Cache()

    def __iter__(self) -> Iterator[FusedView]:
        if self._whole:
            for number, camera in enumerate(self._cameras):
                kept = self._cache.get(number)
                assert kept is not None, "what is kept is not dropped before `clear`"
                depth, color, *weight = kept
                yield FusedView(camera, depth, color, *weight)
            return
        self._cameras = []
        for number, view in enumerate(self._views):
            there = view.on_cpu()
            self._cameras.append(there.camera)
            maps = (there.depth, there.color) if there.weight is None else (there.depth, there.color, there.weight)
            self._cache.put(number, tuple(map(np.asarray, maps)))
            yield FusedView(there.camera, *maps)
        self._whole = True

    def clear(self) -> None:
        """Forget them."""
        self._cache.clear()
