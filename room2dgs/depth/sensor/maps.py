"""A photo's own depth file, at the photo's size."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.config import DepthPriorConfig
from room2dgs.depth.files import decoded_depth, resize_depth
from room2dgs.depth.sensor.error import expected_error, in_reach
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera


class SensorMap(NamedTuple):
    """What a depth camera measured in one photo.

    Attributes:
        depth: (H, W) float32 z-depth, metres; 0 = invalid or out of reach.
        error: (H, W) float32 expected error, metres; infinite where there is no depth.
    """

    depth: np.ndarray
    error: np.ndarray


def sensor_map(frame: Frame, settings: DepthPriorConfig) -> SensorMap:
    """A frame's depth as its file has it, resized to the photo with edges kept, and what it may be off.

    Errors are judged at the file's own size, where a pixel is a pixel of the depth camera.

    Raises:
        InputError: the file cannot be used (`decoded_depth`).
    """
    values = _in_reach(frame, settings)
    error = expected_error(values, _depth_camera(frame, values), settings.sensor)
    depth = _at_photo(values, frame)
    if frame.depth_map is not None:
        error = _seen_by_photo(error, frame)
    elif error.shape != depth.shape:
        error = cv2.resize(error, frame.camera.size, interpolation=cv2.INTER_NEAREST_EXACT)
    return SensorMap(depth, np.where((depth > 0) & (error > 0), error, np.float32(np.inf)))


def sensor_depth(frame: Frame, settings: DepthPriorConfig) -> np.ndarray:
    """The depth of `sensor_map` alone."""
    return _at_photo(_in_reach(frame, settings), frame)


def raw_depth(frame: Frame, settings: DepthPriorConfig) -> np.ndarray:
    """(H, W) float32 metres at the file's own size, 0 = invalid; pixels out of the camera's reach among them.

    Raises:
        InputError: the file cannot be used (`decoded_depth`).
    """
    unit = unit_m(frame, settings)
    if frame.depth_map is None:
        assert frame.depth_path is not None
        return decoded_depth(frame.depth_path, replace(settings, unit_m=unit), frame.camera)[0]
    depth = replace(frame.depth_map, unit_m=unit).metres()
    if not depth.any():
        raise InputError(f"{frame.depth_map.label} has no valid depth; replace it or delete it")
    return depth


def raw_depth_at_photo(frame: Frame, settings: DepthPriorConfig) -> tuple[np.ndarray, bool]:
    """The same at the photo's size, (H, W) float32, and whether any of it is within the camera's reach."""
    values = raw_depth(frame, settings)
    return _at_photo(values, frame), bool(in_reach(values, settings.sensor).any())


def unit_m(frame: Frame, settings: DepthPriorConfig) -> float:
    """Metres of one stored unit: as configured, else what the capture's layout says."""
    own = frame.depth_unit_m if frame.depth_map is None else frame.depth_map.unit_m
    return own if settings.unit_m is None else settings.unit_m


def _in_reach(frame: Frame, settings: DepthPriorConfig) -> np.ndarray:
    values = raw_depth(frame, settings)
    return np.where(in_reach(values, settings.sensor), values, np.float32(0))


def _depth_camera(frame: Frame, values: np.ndarray) -> Camera:
    """The camera that measured; a distorting lens is taken for a pinhole here."""
    height, width = values.shape
    if frame.depth_map is not None and frame.depth_map.K is not None:
        return replace(frame.camera, K=np.array(frame.depth_map.K), width=width, height=height)
    return frame.camera.resized(width, height)


def _at_photo(values: np.ndarray, frame: Frame) -> np.ndarray:
    """(H, W) float32 at the photo's size, 0 = invalid; edges are kept."""
    if frame.depth_map is not None and (frame.depth_map.K is not None or frame.lens is not None):
        return _seen_by_photo(values, frame)
    depth, known = resize_depth(values, values > 0, frame.camera)
    return np.where(known, depth, np.float32(0))


def _seen_by_photo(values: np.ndarray, frame: Frame) -> np.ndarray:
    """Where the photo's rays meet the map."""
    assert frame.depth_map is not None
    return replace(frame.depth_map, read=lambda: values, unit_m=1.0, invalid=None).seen_by(frame.camera, frame.lens)
