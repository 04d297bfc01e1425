"""The capture's own depth camera as a source, and the choice between it and the network that comes with the package."""

from __future__ import annotations

from dataclasses import replace

from room2dgs.depth.sensor.depths import ENOUGH, sensor_depths
from room2dgs.depth.sensor.views import SensorViews, sensor_views
from room2dgs.depth.sources.networks import NETWORK
from room2dgs.depth.sources.source import DepthSource, Proposal, SourceInput


def _sensor(given: SourceInput) -> Proposal:
    return _measured(given, sensor_views(given.frames, given.points, given.prior.depth, given.log))


def _sensor_or_network(given: SourceInput) -> Proposal:
    """The depth camera's depth if at least half of the photos have some, else the network's for all."""
    if any(frame.depth_path for frame in given.frames):
        views = sensor_views(given.frames, given.points, given.prior.depth, given.log)
        if len(views.at_points) >= ENOUGH * len(given.frames):
            return _measured(given, views)
        given.log(
            f"depth: room_prior ({len(views.at_points)} of {len(given.frames)} photos have depth of their own, which "
            "is too few; prior/depth=sensor uses it)"
        )
    return NETWORK.depth(given.with_depth(replace(given.prior.depth, source="room_prior")))


def _measured(given: SourceInput, views: SensorViews) -> Proposal:
    depths, sigmas, fits = sensor_depths(given.frames, views, given.prior.depth, given.log)
    chosen = given.with_depth(replace(given.prior.depth, source="sensor", align=False, joint=False))
    return Proposal(chosen.prior, measured=depths, sigmas=sigmas, fits=fits, models=chosen.models)


SENSOR = DepthSource(_sensor)
AUTO = DepthSource(_sensor_or_network)
