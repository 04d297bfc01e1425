"""Redwood's, Open3D's and Azure Kinect's captures: color/ (or image/), depth/, and a trajectory .log.

The trajectory has five lines a frame: three numbers, the first of them the photo's, then camera-to-world, OpenCV axes,
metres. Depth is millimetres, unless intrinsic.json has another depth_scale.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Shot, damaged, lost, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.known_keys import DISTORTION, check_no_distortion, unknown_keys
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, photos_in
from room2dgs.captures.pairing import alike, note_on, places
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import floats, intrinsic_matrix, lines_of, number, positive, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "color/, depth/ and scene/trajectory.log (Open3D)"
LOGS = ("scene/trajectory.log", "trajectory.log")
PHOTOS = ("color", "image", "rgb", "images")
INTRINSICS = ("intrinsic.json", "camera_intrinsic.json", "intrinsics.json")

KEYS = {
    *DISTORTION,
    *("width", "height", "intrinsic_matrix"),
    # what Open3D's recorders of RealSense and Azure Kinect say besides
    *("color_format", "color_mode", "depth_format", "depth_scale", "device_name", "fps", "serial_number"),
    *("serial_number_", "depth_mode"),
    *("stream_length_usec", "is_k4a", "class_name", "version_major", "version_minor"),
}


def is_open3d(files: Listing) -> bool:
    return any(name in files for name in LOGS)


def read_open3d(root: Path, config: SceneConfig) -> Capture:
    """Read a capture with a .log.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path = next((root / name for name in LOGS if (root / name).is_file()), root / LOGS[0])
    poses = _poses(path)
    folder = next((root / name for name in PHOTOS if (root / name).is_dir()), root / PHOTOS[0])
    photos = photos_in(folder)
    if not photos:
        raise InputError(f"{folder} has no photos; a capture in this layout has {LAYOUT}")
    maps = [name for name in listed(root / "depth") if name.endswith(".png")]
    place = places(photos, 1 + max(poses), path, maps, from_zero=False, keyed=True, keys=poses)
    depths = alike(photos, maps)
    lens, unit, notes = _lens(root, config)
    shots = [
        Shot(
            name,
            folder / name,
            poses.get(place[name], lost(f"{path.name} has no frame {place[name]}")),
            lens,
            depth=depth_file(root / "depth" / depths[name], unit) if name in depths else None,
        )
        for name in photos
    ]
    notes = [*note_on(sum(index in poses for index in place.values()), len(poses), path), *notes]
    return Capture(root, "open3d", shots, gt_mesh=gt_mesh_in(root), why="Open3D's trajectories are metres", notes=notes)


def _poses(path: Path) -> dict[int, np.ndarray | Callable[[], np.ndarray]]:
    """The pose of each frame that a .log names. Blocks begin with a line of three numbers, the first the frame's."""
    blocks: list[list[tuple[int, list[float]]]] = []
    for line, text in lines_of(path):
        values = floats(text, path, line)
        if len(values) == 3 or not blocks:
            blocks.append([])
        blocks[-1].append((line, values))
    poses: dict[int, np.ndarray | Callable[[], np.ndarray]] = {}
    for (line, head), *rows in blocks:
        index = int(head[0]) if len(head) == 3 and 0 <= head[0] < 1e9 else -1
        if index < 0:
            raise InputError(f"{path} line {line} is not the three numbers before a pose; copy it again")
        if index in poses:
            raise InputError(f"{path} line {line} names frame {index} a second time; copy it again")
        if len(rows) == 4 and all(len(row) == 4 for _, row in rows):
            poses[index] = np.array([row for _, row in rows])
        else:
            poses[index] = damaged(InputError(f"{path} line {line} has no 4 lines of 4 numbers behind it"))
    if not poses:
        raise InputError(f"{path} has no poses; copy it again")
    return poses


def _lens(root: Path, config: SceneConfig) -> tuple[Lens | None, float, list[str]]:
    """Open3D's own intrinsic.json, or another's; metres of one unit of depth, and notes."""
    for name in INTRINSICS:
        path = root / name
        if path.is_file():
            known = read_json_object(path)
            check_no_distortion(known, path)
            size = int(number(known, "width", path)), int(number(known, "height", path))
            K = intrinsic_matrix(known, "intrinsic_matrix", path)
            lens = pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], size, path, config.pixel_centres == "half")
            unknown = unknown_keys(known, KEYS, path)
            return lens, 1.0 / positive(known, "depth_scale", path, 1000.0), [unknown] if unknown else []
    return None, 0.001, []


READER = Reader(is_open3d, read_open3d, LAYOUT)
