"""Lengths of a run: its mesh with the errors that are expected of it, and the trust in its scale."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.json_files import read_json
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.export import source_of
from room2dgs.pipeline.unit_estimate import UNIT
from room2dgs.runs.folder import MESH, TRUST, required
from room2dgs.runs.metrics import read_metrics

if TYPE_CHECKING:
    from room2dgs.export.source import Source
    from room2dgs.lengths.length import Length
    from room2dgs.lengths.scale import ScaleTrust
    from room2dgs.lengths.surface import FoundPlane, MeasuredMesh, Spot
    from room2dgs.lengths.targets import Target
    from room2dgs.plan.floor_plan import FloorPlan

PREPARED = "prepare.json"  # in a capture that `room2dgs prepare` made
STEP_M = 0.01  # of a mesh that says nothing of its voxels


class NotSure(InputError):
    """Nothing in a run's folder says how sure its surface is."""


@dataclass(frozen=True)
class MeasuredRun:
    """A run to measure in.

    Attributes:
        source: its parts.
        surface: its mesh with expected errors.
        scale: what all lengths share.
    """

    source: Source
    surface: MeasuredMesh
    scale: ScaleTrust

    @cached_property
    def plan(self) -> FloorPlan:
        """The plan with all lengths measured, in its level frame; scene's frame.

        Raises:
            InputError: no floor, or no room.
        """
        from room2dgs.plan.sigmas import with_sigmas

        return with_sigmas(plan_of(self.source), self.surface.faces, self.scale)

    @cached_property
    def plan_with_openings(self) -> FloorPlan:
        """The plan with doors and windows, where the run kept what its views see.

        Raises:
            InputError: as `plan`.
        """
        from room2dgs.plan.openings import with_openings
        from room2dgs.plan.sight import rays_of
        from room2dgs.plan.wall_picture import look_of
        from room2dgs.runs.mirrors import trusted_depths

        maps = trusted_depths(self.source.folder, self.source.scene)
        if not maps:
            return self.plan
        frames, level_from_world = self.source.scene.train, self.plan.level_from_world
        rays, look = rays_of(frames, maps).turned(level_from_world), look_of(frames, maps, level_from_world)
        return with_openings(self.plan, rays, look, self.scale.sigma)

    def spot(self, target: Target) -> Spot:
        """The mesh at a picked point or pixel.

        Raises:
            InputError: it is not on the mesh, or the photo is not known.
        """
        if target.point is not None:
            return self.surface.nearest(target.point - np.array(self.source.origin_m), target.text)
        assert target.pixel is not None
        camera = _frame(self.source.scene.frames, target.photo).camera
        if not camera.inside(target.pixel[None])[0]:
            raise InputError(f"{target.text} lies outside the photo, which is worked at {camera.width}x{camera.height}")
        ray = camera.turned_to_world(camera.rays_at(target.pixel[None]))[0]
        return self.surface.hit(camera.centre, ray, target.text)

    def plane(self, target: Target) -> FoundPlane:
        """The plane that a target names, or the one around it.

        Raises:
            InputError: the plan has no such plane, or as `spot`.
        """
        if not target.name:
            return self.surface.plane_around(self.spot(target), target.text)
        from room2dgs.lengths.plane_sigma import faces_on, plane_sigma
        from room2dgs.lengths.surface import FoundPlane

        found = next((one for one in self.plan.planes if one.name == target.name), None)
        if found is None:
            names = ", ".join(one.name for one in self.plan.planes)
            raise InputError(f"the plan has no {target.name}; it has {names}")
        normal = found.normal @ self.plan.level_from_world
        faces = self.surface.faces
        on = faces.of(faces_on(faces, normal, found.offset_m))
        middle = np.average(on.middle, axis=0, weights=on.area) if len(on.area) else normal * found.offset_m
        return FoundPlane(normal, found.offset_m, middle, plane_sigma(faces, normal, found.offset_m), found.name)

    def between(self, one: Target, other: Target) -> Length:
        """Between two points, a point and a plane, or two planes.

        Raises:
            InputError: as `spot`, `plane` and the lengths.
        """
        from room2dgs.lengths.between import plane_to_plane, point_to_plane, point_to_point

        if one.plane and other.plane:
            return plane_to_plane(self.plane(one), self.plane(other), self.scale.sigma)
        if one.plane or other.plane:
            point, plane = (other, one) if one.plane else (one, other)
            return point_to_plane(self.spot(point), self.plane(plane), self.scale.sigma)
        return point_to_point(self.spot(one), self.spot(other), self.scale.sigma, self.surface.step_m)


def measured_run(
    config: Config, log: Log = to_terminal, scale_sigma: float | None = None, source: Source | None = None
) -> MeasuredRun:
    """The run in config.out.

    Args:
        scale_sigma: relative deviation of poses that were given as metres; None: `GIVEN_SIGMA`.
        source: its parts, where some are at hand; None: all are read.

    Raises:
        NotSure: nothing tells how sure its mesh is.
        InputError: it has no mesh.
    """
    from room2dgs.lengths.surface import MeasuredMesh
    from room2dgs.lengths.surface_error import expected_errors

    out = Path(config.out)
    path = required(out / MESH, "mesh")
    source = source or source_of(config, log)
    sigma_m = expected_errors(source.mesh)
    if sigma_m is None:
        raise NotSure(
            f"{path} does not say how sure it is; make it again with `room2dgs mesh {out}`, or, where {out} has no "
            f"{TRUST}, run it again with `room2dgs run {config.scene.path} out=ANOTHER`"
        )
    metrics = read_metrics(out)
    surface = MeasuredMesh(source.mesh, sigma_m, float(metrics.get("mesh_voxel_m") or STEP_M))
    return MeasuredRun(source, surface, scale_of_run(config, metrics, source, scale_sigma))


def level_plan(source: Source, config: Config, log: Log) -> tuple[FloorPlan, ScaleTrust | None]:
    """The plan of the run in config.out in its level frame; with openings, measured lengths and what their scale is
    worth, where the run says how sure it is.

    Args:
        source: the run's parts.

    Raises:
        InputError: as `plan_of`, or a damaged file.
    """
    needed_for_plans("shapely")
    try:
        measured = measured_run(config, log, source=source)
        return measured.plan_with_openings, measured.scale
    except NotSure as error:
        log(f"lengths without deviations: {error}")
        return plan_of(source), None


def scale_of_run(config: Config, metrics: dict[str, Any], source: Source, sigma: float | None = None) -> ScaleTrust:
    """What the metres of the run in config.out come from.

    Raises:
        InputError: the capture's prepare.json is damaged.
    """
    from room2dgs.lengths.scale import scale_trust

    noted = metrics.get(UNIT)
    capture = metrics.get("capture")
    metric = bool(capture.get("metric")) if isinstance(capture, dict) else source.scene.metric
    path = Path(config.scene.path) / PREPARED
    prepared = read_json(path).get("scale") if path.is_file() else None
    return scale_trust(
        metric,
        noted if isinstance(noted, dict) else None,
        prepared if isinstance(prepared, dict) else None,
        sigma,
    )


def plan_of(source: Source) -> FloorPlan:
    """The plan of a run's mesh, in its level frame; scene's frame.

    Raises:
        InputError: a library is missing, no way is up, or there is no floor or no room.
    """
    needed_for_plans("shapely")
    from room2dgs.plan.floor_plan import floor_plan

    if source.up is None:
        raise InputError("export.up=keep does not say which way is up; give up=auto or up=z")
    return floor_plan(source.mesh, source.up, np.stack([frame.camera.centre for frame in source.scene.frames]))


def needed_for_plans(*libraries: str) -> None:
    """Libraries that are not always installed.

    Raises:
        InputError: one is missing.
    """
    missing = [name for name in libraries if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"floor plans need {' and '.join(missing)}; install them with pip install 'room2dgs[export]'")


def _frame(frames: tuple[Frame, ...], name: str) -> Frame:
    for frame in frames:
        if name in (frame.name, frame.color_path.name, frame.color_path.stem):
            return frame
    some = ", ".join(frame.name for frame in frames[:3])
    raise InputError(f"no photo is called {name!r}; the run has {some}, ...")
