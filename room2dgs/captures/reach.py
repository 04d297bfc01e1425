"""Checks the distances between cameras: outliers, a wrong pose convention, a wrong unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from room2dgs.captures.capture import (
    C2W_OPENCV,
    C2W_OPENGL,
    W2C_OPENCV,
    W2C_OPENGL,
    Capture,
    Poses,
    disk_pose,
    file_name,
    world_from_cam,
)
from room2dgs.captures.entry import Entry
from room2dgs.captures.left_out import left_out
from room2dgs.captures.scene import Dropped
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

# A room's path of cameras is shorter; lengths in millimetres are a thousand times as long.
LONGEST_PATH_M = 300.0
USUAL_PATH_M = 2.5
SMALL_UNITS = {"millimetres": 0.001, "centimetres": 0.01}
LONE = 100.0  # times the others' reach, from which on a camera is not of this capture: a pose of zeros in UTM


def near_each_other(
    entries: Sequence[Entry], capture: Capture, config: SceneConfig
) -> tuple[list[Entry], list[Dropped], list[str]]:
    """The entries whose cameras stand together, those that do not, and a warning of these.

    Raises:
        InputError: cameras are too far apart for a room; names the reading of the poses or the unit that mends it.
    """
    centres = np.stack([entry.world_from_cam[:3, 3] for entry in entries])
    if _reach(centres) <= LONGEST_PATH_M or not (capture.metric or config.given_unit is None):
        return list(entries), [], []
    off = np.linalg.norm(centres - np.median(centres, axis=0), axis=1)
    together = off <= LONGEST_PATH_M
    if together.any() and off[~together].min(initial=np.inf) > LONE * max(_reach(centres[together]), USUAL_PATH_M):
        bad = {
            entry.shot.name: f"{entry.shot.path} has a pose {distance:,.0f} m from the others; delete the frame"
            for entry, distance, good in zip(entries, off, together, strict=True)
            if not good
        }
        warning = left_out(bad, len(entries), "poses far from all others")
        kept = [entry for entry, good in zip(entries, together, strict=True) if good]
        return kept, [Dropped(file_name(name), reason) for name, reason in bad.items()], [warning] if warning else []
    reach = _reach(centres)
    message = f"{capture.root} has cameras {reach:,.0f} m apart"
    other = _other_reading(entries, capture.poses if config.poses == "auto" else config.poses)
    if other is not None:
        raise InputError(f"{message}; read as {other.replace('_', ' ')} they stand together: give scene.poses={other}")
    name, metres = min(SMALL_UNITS.items(), key=lambda entry: abs(np.log(reach * entry[1] / USUAL_PATH_M)))
    raise InputError(
        f"{message}: its poses look like {name}; give scene.unit={metres:g} (metres of one unit of the poses)"
    )


def _reach(centres: np.ndarray) -> float:
    return float(np.linalg.norm(np.ptp(centres, axis=0)))


def _other_reading(entries: Sequence[Entry], was: Poses) -> Poses | None:
    """The inverse reading, if cameras far from the origin stand together with it: the wrong one turns the distance."""
    pairs = (C2W_OPENCV, W2C_OPENCV), (C2W_OPENGL, W2C_OPENGL)
    inverse = {one: other for pair in pairs for one, other in (pair, pair[::-1])}
    other: Poses = inverse[was]
    centres = np.stack([world_from_cam(disk_pose(entry.world_from_cam, was), other)[:3, 3] for entry in entries])
    near = _reach(centres) <= LONGEST_PATH_M
    return other if near and np.abs(centres).max() > LONE * USUAL_PATH_M else None
