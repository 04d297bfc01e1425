"""The photos whose own depth can be used, each decoded once: is the file whole, and does it fit the points?"""

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
from room2dgs.logs import Log
from room2dgs.texts import some_of

NO_FILE = "no file"


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


def sensor_views(frames: Sequence[Frame], points: PointCloud, settings: DepthPriorConfig, log: Log) -> SensorViews:
    """Decode every photo's depth file; damaged and missing ones are logged, not raised."""
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
    _log_unusable(found, len(frames), log)
    return found


def _log_unusable(views: SensorViews, count: int, log: Log) -> None:
    missing = [name for name, why in views.without.items() if why == NO_FILE]
    broken = {name: why for name, why in views.without.items() if why != NO_FILE}
    if missing and len(missing) < count:
        log(f"depth: {len(missing)} of {count} photos have no depth file: {some_of(missing)}")
    if broken:
        first = next(iter(broken.values()))
        more = f" (and {len(broken) - 1} more depth files: {some_of(list(broken)[1:])})" if len(broken) > 1 else ""
        log(f"depth: the run goes on without {next(iter(broken))}'s, {first}{more}")
    if views.out_of_reach:
        log(f"depth: nothing within the sensor's reach in {some_of(views.out_of_reach)}")
