"""Rendered depth and normals of every view, raw: 16-bit PNG and float32 .npy, with their cameras beside them."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.world_offset import camera_in_world
from room2dgs.export.source import Source
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera
from room2dgs.splat.types import Rendering

MIN_ALPHA = 0.5  # less covered pixels hold nothing
MILLIMETRES = 1000.0
FARTHEST_MM = 65535


def write_maps(source: Source, folder: Path, encode: Callable[[Frame, Rendering], bytes], suffix: str) -> list[Path]:
    """A file for each view and cameras.json.

    Args:
        encode: a view's rendering as the file's bytes.
    """
    written = []
    for frame, rendering in source.render(source.surfels, source.scene.frames):
        path = folder / f"{frame.name}{suffix}"
        with whole_file(path) as temporary:
            temporary.write_bytes(encode(frame, rendering))
        written.append(path)
    cameras = {
        frame.name: camera_entry(camera_in_world(frame.camera, source.origin_m)) for frame in source.scene.frames
    }
    with whole_file(folder / "cameras.json") as temporary:
        temporary.write_text(json.dumps(cameras, indent=1) + "\n", encoding="utf-8")
    return [*written, folder / "cameras.json"]


def camera_entry(camera: Camera) -> dict[str, object]:
    """Pixels with centres at +0.5, OpenCV axes, metres."""
    return {
        "width": camera.width,
        "height": camera.height,
        "K": camera.K.tolist(),
        "cam_from_world": camera.cam_from_world.tolist(),
    }


def depth_png(_: Frame, rendering: Rendering) -> bytes:
    """Median z-depth in millimetres, 0 = nothing known or farther than 65 m."""
    millimetres = np.round(_depth(rendering) * MILLIMETRES)
    return _png(np.where(millimetres <= FARTHEST_MM, millimetres, 0).astype(np.uint16))


def depth_npy(_: Frame, rendering: Rendering) -> bytes:
    """(H, W) float32 median z-depth, metres, 0 = nothing known."""
    return _npy(_depth(rendering))


def normal_png(_: Frame, rendering: Rendering) -> bytes:
    """RGB = x, y, z of the world from -1..1 to 0..65535; (0, 0, 0) = nothing known."""
    normal = _normal(rendering)
    levels = np.round((normal + 1) / 2 * 65535).astype(np.uint16)
    return _png(np.where(np.any(normal != 0, axis=-1, keepdims=True), levels, 0)[..., ::-1].astype(np.uint16))


def normal_npy(_: Frame, rendering: Rendering) -> bytes:
    """(H, W, 3) float32 unit normals, world frame, facing the camera; 0 = nothing known."""
    return _npy(_normal(rendering))


def _depth(rendering: Rendering) -> np.ndarray:
    return np.where(rendering.alpha.numpy() >= MIN_ALPHA, rendering.median_depth.numpy(), 0).astype(np.float32)


def _normal(rendering: Rendering) -> np.ndarray:
    normal = rendering.normal.numpy().astype(np.float32)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    known = (rendering.alpha.numpy() >= MIN_ALPHA)[..., None] & (length > 0)
    return np.where(known, normal / np.maximum(length, 1e-12), 0).astype(np.float32)


def _png(values: np.ndarray) -> bytes:
    return cv2.imencode(".png", values)[1].tobytes()


def _npy(values: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, values)
    return buffer.getvalue()
