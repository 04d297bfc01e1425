"""What a reader finds on disk, before anything is chosen, undistorted or resized."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.lens import Lens
from room2dgs.captures.photos import Photo, PhotoFile
from room2dgs.errors import InputError
from room2dgs.geometry.poses import inverse_pose

Poses = Literal["camera_to_world_opencv", "camera_to_world_opengl", "world_to_camera_opencv", "world_to_camera_opengl"]
C2W_OPENCV, C2W_OPENGL, W2C_OPENCV, W2C_OPENGL = ALL_POSES = get_args(Poses)
TURNED = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL's camera axes to OpenCV's, and back


class Lost(ValueError):
    """A frame has no pose; the text says why."""


def lost(reason: str) -> Callable[[], np.ndarray]:
    """What a shot without a pose has as one."""

    def pose() -> np.ndarray:
        raise Lost(reason)

    return pose


def damaged(error: InputError) -> Callable[[], np.ndarray]:
    """What a shot has as a pose whose numbers, or whose camera's, are damaged."""

    def pose() -> np.ndarray:
        raise error

    return pose


@dataclass(frozen=True)
class Shot:
    """One photo of a capture.

    Attributes:
        name: unique; the file's own.
        path: of the photo, or what it would be called as a file of its own.
        pose: (4, 4) as on disk, or a function that reads a rigid one and may raise `Lost`, or InputError where it is
            damaged; None: it has none. Either costs the shot, and damage of many the capture.
        lens: None: the capture brings none.
        photo: where it is no file of its own.
        depth: what a sensor measured.
        mask: white where the photo may be used.
    """

    name: str
    path: Path
    pose: np.ndarray | Callable[[], np.ndarray] | None
    lens: Lens | None
    photo: Photo | None = None
    depth: DepthMap | Path | None = None
    mask: Photo | None = None

    @property
    def source(self) -> Photo:
        return self.photo or PhotoFile(self.path)


@dataclass(frozen=True)
class RawPoints:
    """Sparse points as on disk.

    Attributes:
        xyz: (M, 3) in the capture's world.
        rgb: (M, 3) uint8.
        error_px: (M,) mean reprojection error; None: unknown.
        shots: names of the photos of the observations.
        shot: (O,) int32 index into `shots`; point: (O,) int32; pixel: (O, 2) in a photo of the size that the shot's
            intrinsics are for, centres at +0.5. None without tracks.
    """

    xyz: np.ndarray
    rgb: np.ndarray
    error_px: np.ndarray | None = None
    shots: tuple[str, ...] = ()
    shot: np.ndarray | None = None
    point: np.ndarray | None = None
    pixel: np.ndarray | None = None


@dataclass
class Capture:
    """A capture on disk.

    Attributes:
        root: its folder or file.
        layout: the reader's name.
        shots: in the order in which they were taken.
        poses: what the shots' poses mean.
        metric: whether the numbers are metres, and `why`.
        world_from_disk: (4, 4) rotation, translation and one scale that lead from the poses' world to the capture's
            own; None: it is the same.
        test: names of the photos that the capture holds out; None: it does not say.
        points: reads the sparse points that the capture brings.
        gt_mesh: the true surface in the capture's world.
        notes: sentences for the log; warnings: what may be wrong, for the report too.
    """

    root: Path
    layout: str
    shots: Sequence[Shot]
    poses: Poses = C2W_OPENCV
    metric: bool = True
    why: str = "the layout's poses are metres"
    world_from_disk: np.ndarray | None = None
    test: frozenset[str] | None = None
    points: Callable[[], RawPoints] | None = None
    gt_mesh: Path | None = None
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def world_from_cam(matrix: np.ndarray, poses: Poses) -> np.ndarray:
    """(4, 4) camera-to-world with OpenCV axes from a rigid pose that means something else."""
    if poses.startswith("world_to_camera"):
        matrix = inverse_pose(matrix if poses.endswith("opencv") else TURNED @ matrix)
    elif poses.endswith("opengl"):
        matrix = matrix @ TURNED
    return matrix


def disk_pose(pose: np.ndarray, poses: Poses) -> np.ndarray:
    """The way back from `world_from_cam`."""
    if poses.startswith("world_to_camera"):
        matrix = inverse_pose(pose)
        return matrix if poses.endswith("opencv") else TURNED @ matrix
    return pose @ TURNED if poses.endswith("opengl") else pose


def pose_in_world(pose: np.ndarray, world_from_disk: np.ndarray) -> np.ndarray:
    """(4, 4) rigid camera-to-world pose in another world, which may differ in scale too."""
    scale = np.cbrt(np.linalg.det(world_from_disk[:3, :3]))
    result = np.eye(4)
    result[:3, :3] = world_from_disk[:3, :3] @ pose[:3, :3] / scale
    result[:3, 3] = world_from_disk[:3, :3] @ pose[:3, 3] + world_from_disk[:3, 3]
    return result


def pinhole_lens(
    fx: float, fy: float, cx: float, cy: float, size: tuple[int, int] | None, source: object, half: bool
) -> Lens:
    """A lens without distortion.

    Args:
        half: cx, cy count pixel centres at +0.5; False: at integers.

    Raises:
        InputError: it is no camera.
    """
    shift = 0.0 if half else 0.5
    lens = Lens("PINHOLE", (float(fx), float(fy), cx + shift, cy + shift), size, str(source))
    lens.check()
    return lens


def file_name(name: str) -> str:
    """A photo's name as a frame's: without suffix and folders' slashes, fit for a file."""
    stem = name[: -len(Path(name).suffix)] if Path(name).suffix else name
    text = "".join(letter if letter.isalnum() or letter in "._-+ " else "_" for letter in stem.replace("\\", "/"))
    text = text.strip(" ")
    if not text.strip("._"):
        raise InputError(f"{name!r} is no name of a photo; name it by letters or digits")
    return text if not text.startswith(".") else "_" + text
