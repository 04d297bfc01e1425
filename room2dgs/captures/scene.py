"""What every reader of a capture fills in, whatever the layout on disk."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.cache import Cache
from room2dgs.captures.image_files import read_photo
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera


@dataclass(frozen=True)
class Frame:
    """One posed photo; pixels are read when asked for, at the size of `camera`.

    Attributes:
        name: unique in the scene, sorts in capture order ("000012").
        camera: pose and intrinsics at the working image size.
        color_path: the photo.
        depth_path: registered depth map or None.
        depth_unit_m: metres of one unit of the depth file (0.001 for millimetres).
        cache: where the decoded photo is kept; None: it is decoded each time.
    """

    name: str
    camera: Camera
    color_path: Path
    depth_path: Path | None = None
    depth_unit_m: float = 0.001
    cache: Cache | None = field(default=None, repr=False, compare=False)

    def color(self) -> np.ndarray:
        """(H, W, 3) uint8 RGB, area-averaged down to the camera's size; orientation tags are not applied.

        It is shared with the cache: do not write to it.

        Raises:
            InputError: the file cannot be decoded.
        """
        size = (self.camera.width, self.camera.height)
        if self.cache is None:
            return read_photo(self.color_path, size)
        return self.cache.get_or(("photo", self.color_path, size), lambda: (read_photo(self.color_path, size),))[0]

    def depth(self) -> np.ndarray | None:
        """(H, W) float32 z-depth in metres, 0 = invalid, nearest-sampled to the camera's size.

        None without a file.

        Raises:
            InputError: the file cannot be decoded.
        """
        if self.depth_path is None:
            return None
        depth = cv2.imread(str(self.depth_path), cv2.IMREAD_UNCHANGED)
        if depth is None or depth.ndim != 2:
            raise InputError(f"{self.depth_path} cannot be decoded as a one-channel depth map; replace it")
        size = (self.camera.width, self.camera.height)
        if (depth.shape[1], depth.shape[0]) != size:
            depth = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST)
        return depth.astype(np.float32) * np.float32(self.depth_unit_m)


@dataclass(frozen=True)
class Dropped:
    """A frame that was left out, and why (one sentence for the log)."""

    name: str
    reason: str


@dataclass(frozen=True)
class Scene:
    """A capture: training and held-out views in capture order.

    Attributes:
        path: the capture's folder.
        train, test: disjoint views.
        dropped: frames on disk that cannot be used, with reasons.
        gt_mesh: ground-truth mesh in the same world frame, if there is one.
        cache: of all that is kept of the views.
    """

    path: Path
    train: tuple[Frame, ...]
    test: tuple[Frame, ...]
    dropped: tuple[Dropped, ...] = field(default=())
    gt_mesh: Path | None = None
    cache: Cache = field(default_factory=Cache, repr=False, compare=False)

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Training and test views together, in capture order."""
        return tuple(sorted(self.train + self.test, key=lambda frame: frame.name))

    @property
    def extent(self) -> float:
        """Metres: 1.1 x the largest distance of a training camera from their mean (2DGS's scene radius)."""
        centres = np.stack([frame.camera.centre for frame in self.train])
        return 1.1 * float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())
