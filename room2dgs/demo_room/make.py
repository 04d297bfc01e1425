"""Makes a furnished room with exact ground truth in the ScanNet layout (`room2dgs demo`).

Written is what `capture_files` says; gt_mesh.ply is only what the cameras saw. The same options give the same bytes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from room2dgs.demo_room.capture_files import (
    check_free,
    check_limits,
    exposure_gains,
    make_folders,
    write_frame,
    write_intrinsics,
    write_poses,
    write_truth,
)
from room2dgs.demo_room.layout import room_patches
from room2dgs.demo_room.mesh import visible_mesh
from room2dgs.demo_room.path import FRAMES_A_LAP, camera_path
from room2dgs.demo_room.render import build_room, exposed, pinhole, render
from room2dgs.files import whole_folder


@dataclass(frozen=True)
class RoomOptions:
    """What to make.

    Attributes:
        seed: fixes the arrangement, the textures, the walk and the noise.
        frames: photos along the walk.
        frames_a_lap: of them, once around the room; with some hundred it is a video at 30 frames a second.
        width, height: of the photos, pixels.
        fov: horizontal field of view, degrees.
        noise: deviation of the image noise, 8-bit levels.
        exposure_drift: largest change of exposure along the walk, stops.
        blank_walls: walls of uniform paint, 0 to 4.
        gloss: mirror reflection of the floor, 0 (matt, no view dependence) to 1 (polished).
        jpeg_quality: 1 to 100.
    """

    seed: int = 0
    frames: int = 60
    frames_a_lap: int = FRAMES_A_LAP
    width: int = 320
    height: int = 240
    fov: float = 70.0
    noise: float = 1.0
    exposure_drift: float = 0.0
    blank_walls: int = 0
    gloss: float = 0.0
    jpeg_quality: int = 95


LIMITS = {
    "seed": (0, 2**63 - 1),
    "frames": (1, 100_000),
    "frames_a_lap": (4, 100_000),
    "width": (16, 8192),
    "height": (16, 8192),
    "fov": (10, 150),
    "noise": (0, 100),
    "exposure_drift": (0, 4),
    "blank_walls": (0, 4),
    "gloss": (0, 1),
    "jpeg_quality": (1, 100),
}


def make_room(out: Path | str, options: RoomOptions | None = None, overwrite: bool = False) -> Path:
    """Writes a capture of a furnished room; it appears at `out` only when it is complete.

    Args:
        out: folder to write.
        options: what to make; the defaults are the demo.
        overwrite: replace an earlier room at `out`.

    Returns:
        `out`.

    Raises:
        InputError: an option is out of range, or `out` holds something that must not be replaced.
    """
    options = options or RoomOptions()
    check_limits(options, LIMITS)
    out = Path(out)
    check_free(out, overwrite)
    with whole_folder(out) as partial:
        write_capture(partial, options)
    return out


def write_capture(out: Path, options: RoomOptions) -> None:
    """Writes all files of the capture into the empty folder `out`."""
    room = build_room(room_patches(options.seed, options.blank_walls), options.seed)
    poses = camera_path(options.frames, room.distance, np.random.default_rng([options.seed, 4]), options.frames_a_lap)
    K = pinhole(options.width, options.height, options.fov)
    gains = exposure_gains(options.frames, options.exposure_drift, np.random.default_rng([options.seed, 6]))
    make_folders(out)
    for index, world_from_cam in enumerate(poses):
        color, depth = render(room, K, world_from_cam, options.width, options.height, options.gloss)
        photo = exposed(color, gains[index], options.noise, np.random.default_rng([options.seed, 5, index]))
        write_frame(out, index, photo, depth, options.jpeg_quality)
    write_poses(out / "pose", poses)
    write_intrinsics(out, K)
    write_truth(out, visible_mesh(room, room.patches, K, poses, options.width, options.height), asdict(options))
