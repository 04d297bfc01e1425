"""The sparse points of a capture, read when they are needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from room2dgs.captures.capture import Capture
from room2dgs.captures.given_points import given_points
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.world_offset import AT_ORIGIN, Origin, points_in_scene


@dataclass(frozen=True)
class CapturePoints:
    """Called, it gives the points as some frames see them.

    Attributes:
        frames: the views whose observations count.
        shots: frame name -> shot name.
        unit: metres of one unit of the capture; None: 1.
        origin_m: of the scene, in the capture's world.
    """

    capture: Capture
    frames: tuple[Frame, ...]
    shots: Mapping[str, str]
    unit: float | None
    origin_m: Origin = AT_ORIGIN

    def __call__(self) -> PointCloud:
        """The points, read anew.

        Raises:
            InputError: they cannot be read.
        """
        read = partial(given_points, self.capture, self.frames, self.shots, self.unit)
        return points_in_scene(read, self.origin_m)

    def of(self, frames: Sequence[Frame]) -> CapturePoints:
        """The same as other frames see them."""
        return replace(self, frames=tuple(frames))

    def observations(self) -> list[tuple[str, np.ndarray]]:
        """(frame's name, (N, 2) places in the photo as stored, 0..1) of all observations, of hidden ones too.

        Raises:
            InputError: the points cannot be read.
        """
        assert self.capture.points is not None, "the capture brings no points"
        raw = self.capture.points()
        if raw.shot is None or raw.pixel is None:
            return []
        number = {name: index for index, name in enumerate(raw.shots)}
        lenses = {shot.name: shot.lens for shot in self.capture.shots}
        order = np.argsort(raw.shot, kind="stable")
        bounds = np.searchsorted(raw.shot[order], np.arange(len(raw.shots) + 1))
        found = []
        for frame in self.frames:
            name = self.shots[frame.name]
            place = number.get(name)
            if place is None:
                continue
            lens = lenses[name]
            pixel = raw.pixel[order[bounds[place] : bounds[place + 1]]]
            stored = frame.lens.known_size if frame.lens else frame.full_size()
            at = pixel / ((lens.size if lens is not None else None) or stored)
            found.append((frame.name, at[((at >= 0) & (at < 1)).all(axis=1)]))
        return found
