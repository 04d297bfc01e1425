"""A scene as it is, and how numbers and pictures get into files; the writers of all layouts share it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

GL = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL's camera axes


@dataclass(frozen=True)
class Made:
    """A scene whose every number is known.

    Attributes:
        K: (3, 3) of all photos, pixel centres at +0.5, no skew.
        size: (width, height) that it is for; the photos' own.
        poses: (N, 4, 4) camera-to-world, metres, OpenCV axes.
        photos: (N, H, W, 3) uint8 BGR.
        depths: (N, H, W) uint16, whole millimetres, 0 = unknown.
        xyz: (M, 3) points; rgb: (M, 3) uint8.
        seen: for each photo, (O,) indices of points and (O, 2) pixels, centres at +0.5.
        jpegs: files that hold just `photos`; None: they are packed when they are written, and lose a little.
        mask: (H, W) uint8 of every photo, 255 = may be used, where a layout has masks; None: all of it may.
    """

    K: np.ndarray
    size: tuple[int, int]
    poses: np.ndarray
    photos: np.ndarray
    depths: np.ndarray
    xyz: np.ndarray
    rgb: np.ndarray
    seen: list[tuple[np.ndarray, np.ndarray]]
    jpegs: tuple[bytes, ...] | None = None
    mask: np.ndarray | None = None

    @property
    def count(self) -> int:
        return len(self.poses)

    @property
    def width(self) -> int:
        return self.size[0]

    @property
    def height(self) -> int:
        return self.size[1]

    @property
    def fx_fy_cx_cy(self) -> list[float]:
        """Pixel centres at +0.5."""
        return [float(value) for value in (self.K[0, 0], self.K[1, 1], self.K[0, 2], self.K[1, 2])]

    @property
    def counted_at_integers(self) -> list[float]:
        """The same with the first pixel's centre at 0."""
        fx, fy, cx, cy = self.fx_fy_cx_cy
        return [fx, fy, cx - 0.5, cy - 0.5]

    @property
    def K_at_integers(self) -> np.ndarray:
        """(4, 4)."""
        K = np.eye(4)
        K[0, 0], K[1, 1], K[0, 2], K[1, 2] = self.counted_at_integers
        return K

    def jpeg(self, index: int) -> bytes:
        """A photo as a JPEG file's bytes."""
        if self.jpegs is not None:
            return self.jpegs[index]
        return cv2.imencode(".jpg", self.photos[index])[1].tobytes()


def photo_file(path: Path, made: Made, index: int) -> None:
    """A photo as its name ends."""
    if path.suffix.lower() == ".jpg":
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(made.jpeg(index))
    else:
        image_file(path, made.photos[index])


def image_file(path: Path, image: np.ndarray) -> None:
    """A picture or a map without loss."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())


def wxyz(rotation: np.ndarray) -> np.ndarray:
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def text(values) -> str:
    """All digits of some numbers."""
    return " ".join(f"{value:.17g}" for value in np.ravel(values))


def rows(matrix: np.ndarray) -> str:
    """A line for each row."""
    return "\n".join(text(row) for row in matrix) + "\n"


def lists(matrix: np.ndarray) -> list[list[float]]:
    """For json."""
    return [[float(value) for value in row] for row in matrix]
