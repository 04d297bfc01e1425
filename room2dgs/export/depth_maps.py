"""Rendered depth and normals of every view, raw: 16-bit PNG and float32 .npy, with their cameras beside them."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from room2dgs.captures.world_offset import camera_in_world
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera
from room2dgs.logs import Log

if TYPE_CHECKING:  # `room2dgs render` shares what is here, and its help should not wait for torch
    from room2dgs.export.source import Source
    from room2dgs.splat.types import Rendering

MILLIMETRES = 1000.0
FARTHEST_MM = 65535  # that a 16-bit picture holds


class TooFar:
    """How many pixels were farther than 16-bit millimetres hold."""

    def __init__(self) -> None:
        self.pixels, self.views = 0, 0

    def add(self, pixels: int) -> None:
        """Those of one view."""
        self.pixels += pixels
        self.views += pixels > 0

    def log_to(self, log: Log, instead: str) -> None:
        """A line if there were any; `instead` is the argument that writes metres."""
        if self.pixels:
            where = f"{self.pixels:,} pixels of {self.views} views"
            log(
                f"depth: {where} are farther than {FARTHEST_MM / MILLIMETRES:g} m, more than 16-bit millimetres hold; "
                f"they are 0 (unknown). {instead} writes metres"
            )


def write_depth(source: Source, folder: Path) -> list[Path]:
    """Millimetres, PNG."""
    return _write_maps(source, folder, depth_png, ".png")


def write_depth_npy(source: Source, folder: Path) -> list[Path]:
    """Metres, .npy."""
    return _write_maps(source, folder, depth_npy, ".npy")


def write_normals(source: Source, folder: Path) -> list[Path]:
    """World frame, PNG."""
    return _write_maps(source, folder, normal_png, ".png")


def write_normals_npy(source: Source, folder: Path) -> list[Path]:
    """World frame, .npy."""
    return _write_maps(source, folder, normal_npy, ".npy")


def _write_maps(source: Source, folder: Path, encode: Callable[[Rendering, TooFar], bytes], suffix: str) -> list[Path]:
    """A file for each view and cameras.json; depth that the format does not hold is told in the log.

    Args:
        encode: a view's rendering as the file's bytes; counts what is too far for them.
    """
    written, far = [], TooFar()
    for frame, rendering in source.render(source.surfels, source.scene.frames):
        path = folder / f"{frame.name}{suffix}"
        with whole_file(path) as temporary:
            temporary.write_bytes(encode(rendering, far))
        written.append(path)
    far.log_to(source.log, "to=depth_npy")
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


def in_millimetres(depth: np.ndarray, far: TooFar) -> np.ndarray:
    """(H, W) uint16 of metres, 0 = nothing known or farther than 65.535 m; counts the latter."""
    millimetres = np.round(depth * MILLIMETRES)
    fits = millimetres <= FARTHEST_MM
    far.add(int(np.count_nonzero(~fits)))
    return np.where(fits, millimetres, 0).astype(np.uint16)


def depth_png(rendering: Rendering, far: TooFar) -> bytes:
    """Median z-depth in millimetres (`in_millimetres`)."""
    return _png(in_millimetres(rendering.covered_depth().numpy(), far))


def depth_npy(rendering: Rendering, _: TooFar) -> bytes:
    """Median z-depth in metres (`Rendering.covered_depth`)."""
    return as_npy(rendering.covered_depth().numpy())


def normal_png(rendering: Rendering, _: TooFar) -> bytes:
    """RGB = x, y, z of the world from -1..1 to 0..65535; (0, 0, 0) = nothing known."""
    normal = _normal(rendering)
    levels = np.round((normal + 1) / 2 * 65535).astype(np.uint16)
    return _png(np.where(np.any(normal != 0, axis=-1, keepdims=True), levels, 0)[..., ::-1].astype(np.uint16))


def normal_npy(rendering: Rendering, _: TooFar) -> bytes:
    """(H, W, 3) float32 unit normals, world frame, facing the camera; 0 = nothing known."""
    return as_npy(_normal(rendering))


def as_npy(values: np.ndarray) -> bytes:
    """The bytes of a .npy file."""
    buffer = io.BytesIO()
    np.save(buffer, values)
    return buffer.getvalue()


def _normal(rendering: Rendering) -> np.ndarray:
    normal = rendering.normal.numpy().astype(np.float32)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    known = rendering.covered.numpy()[..., None] & (length > 0)
    return np.where(known, normal / np.maximum(length, 1e-12), 0).astype(np.float32)


def _png(values: np.ndarray) -> bytes:
    return cv2.imencode(".png", values)[1].tobytes()
