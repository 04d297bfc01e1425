"""The photos whose own depth can be used, each looked at once: is the file whole, and does it fit the points?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.sensor.at_points import AtPoints, at_points
from room2dgs.depth.sensor.maps import raw_depth_at_photo
from room2dgs.errors import InputError


@dataclass
class SensorViews:
    """What the depth files of some photos are good for.

    Attributes:
        frames: with depth that can be used.
        without: frame name -> why its depth cannot be used, one sentence; "no file" without one.
        at_points: frame name -> its depth at the sparse points, of `frames` and of `out_of_reach`.
        out_of_reach: names of frames with a whole file but no pixel between `sensor.min_m` and `sensor.max_m`.
    """

    frames: list[Frame] = field(default_factory=list)
    without: dict[str, str] = field(default_factory=dict)
    at_points: dict[str, AtPoints] = field(default_factory=dict)
    out_of_reach: list[str] = field(default_factory=list)


def sensor_views(frames: Sequence[Frame], points: PointCloud, settings: DepthPriorConfig) -> SensorViews:
    """Decode every photo's depth file; damaged and missing ones are told, not raised."""
    found = SensorViews()
    for frame in frames:
        if frame.depth_path is None:
            found.without[frame.name] = NO_FILE
            continue
        try:
            depth, reached = raw_depth_at_photo(frame, settings)
        except InputError as problem:
            found.without[frame.name] = str(problem)
            continue
        # beyond the reach, too: with a wrong unit everything is
        found.at_points[frame.name] = at_points(depth, seen_points(points, frame))
        if reached:
            found.frames.append(frame)
        else:
            found.out_of_reach.append(frame.name)
    return found


NO_FILE = "no file"
