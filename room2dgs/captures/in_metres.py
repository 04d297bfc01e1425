"""A capture whose poses have no metres, scaled by an estimate of their unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from room2dgs.captures.capture_points import CapturePoints
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame, Scene
from room2dgs.geometry.camera import Camera

MEND = "give scene.unit=METRES of one unit if you know it"


@dataclass(frozen=True)
class EstimatedUnit:
    """How long one unit of a capture's poses is.

    Attributes:
        metres: of one unit.
        sigma: relative standard deviation of it.
        photos: in how many photos it was measured.
    """

    metres: float
    sigma: float
    photos: int

    def as_dict(self) -> dict[str, Any]:
        """Plain values, digits enough for the same bits."""
        return asdict(self)

    def sentence(self) -> str:
        """For the log and the report."""
        return (
            f"1 unit of the poses is about {self.metres:.2g} m (± {100 * self.sigma:.0f} %), by the depth prior of "
            f"{self.photos} photos"
        )


def unit_of_dict(values: Mapping[str, Any]) -> EstimatedUnit:
    """The way back from `EstimatedUnit.as_dict`.

    Raises:
        ValueError, LookupError, TypeError: the values are none.
    """
    unit = EstimatedUnit(float(values["metres"]), float(values["sigma"]), int(values["photos"]))
    if not 0 < unit.metres < float("inf"):
        raise ValueError
    return unit


def in_metres(scene: Scene, unit: EstimatedUnit) -> Scene:
    """The scene with cameras, points of the capture and origin in metres.

    Args:
        scene: in the capture's unit.
    """

    def scaled(frames: Sequence[Frame]) -> tuple[Frame, ...]:
        return tuple(replace(frame, camera=scaled_camera(frame.camera, unit.metres)) for frame in frames)

    train, test = scaled(scene.train), scaled(scene.test)
    x, y, z = (unit.metres * value for value in scene.origin_m)
    points = scene.given_points
    if isinstance(points, CapturePoints):
        points = replace(points.of(train), unit=unit.metres, origin_m=(x, y, z))
    warning = f"{unit.sentence()}: all lengths may be off by as much; {MEND}"
    return replace(
        scene,
        train=train,
        test=test,
        given_points=points,
        origin_m=(x, y, z),
        metric=True,
        unit_m=unit.metres,
        warnings=(*scene.warnings, warning),
    )


def scaled_camera(camera: Camera, factor: float) -> Camera:
    """The camera in a world that is so many times as large."""
    cam_from_world = camera.cam_from_world.copy()
    cam_from_world[:3, 3] *= factor
    return replace(camera, cam_from_world=cam_from_world)


def scaled_points(points: PointCloud, factor: float) -> PointCloud:
    """The points in a world that is so many times as large."""
    return replace(points, xyz=points.xyz * factor)
