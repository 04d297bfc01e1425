"""Pictures of depth and normals, as people can read them, and PNG files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera


def depth_picture(depth: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 RGB: near red, far blue (2nd to 98th percentile), black where not covered."""
    seen = covered & (depth > 0)
    if not seen.any():
        return np.zeros((*depth.shape, 3), np.uint8)
    near, far = np.percentile(depth[seen], [2, 98])
    nearness = 1 - np.clip((depth - near) / max(far - near, 1e-6), 0, 1)
    bgr = cv2.applyColorMap(np.round(nearness * 255).astype(np.uint8), cv2.COLORMAP_TURBO)
    return np.where(seen[..., None], bgr[..., ::-1], 0).astype(np.uint8)


def normal_picture(normal: np.ndarray, camera: Camera, covered: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 RGB: the normal's right, up and towards-the-camera parts; black where not covered."""
    in_camera = camera.turned_to_camera(normal) * (1, -1, -1)
    length = np.linalg.norm(in_camera, axis=-1, keepdims=True)
    picture = np.round((in_camera / np.maximum(length, 1e-9) + 1) / 2 * 255)
    return np.where(covered[..., None] & (length > 0), picture, 0).astype(np.uint8)


def write_png(path: Path, picture: np.ndarray) -> None:
    """(H, W, 3) uint8 RGB or (H, W) uint16, whole or not at all."""
    bgr = picture[..., ::-1] if picture.ndim == 3 else picture
    with whole_file(path) as temporary:
        temporary.write_bytes(cv2.imencode(".png", bgr)[1].tobytes())
