"""Record3D: an .r3d archive, or its "EXR + RGB" export: metadata (JSON), rgbd/ or rgb/ and depth/.

Poses are camera-to-world with OpenGL axes, metres, and a photo's is the one of its number; K goes down the columns and
holds at w x h. Depth in an .r3d is packed by LZFSE (the extra `phones`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.archives import MAX_ENTRY_BYTES, Archive
from room2dgs.captures.capture import C2W_OPENGL, Capture, Shot, damaged, pinhole_lens
from room2dgs.captures.depth_maps import DepthMap, depth_file
from room2dgs.captures.known_keys import DISTORTION, check_no_distortion, unknown_keys
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural
from room2dgs.captures.lzfse import unpacked_lzfse
from room2dgs.captures.pairing import note_on, places
from room2dgs.captures.photos import PhotoBytes
from room2dgs.captures.reader import Reader
from room2dgs.captures.readers.sens import the_file
from room2dgs.captures.text_files import intrinsic_matrix, number, numbers, quaternion_pose, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.regular_files import read_regular

LAYOUT = "<name>.r3d, or metadata.json with rgb/ (Record3D)"
METADATA = ("metadata.json", "metadata")
PHOTOS = ("rgb", "rgbd")
SUFFIXES, DEPTHS = (".jpg", ".jpeg", ".png"), (".depth", ".exr")
KEYS = {
    *DISTORTION,
    *("w", "h", "dw", "dh", "K", "poses", "perFrameIntrinsicCoeffs", "frameTimestamps"),
    *("fps", "initPose", "cameraType"),  # change nothing
}
MAX_SIDE = 1 << 14


def is_record3d(files: Listing) -> bool:
    if files.with_suffix((".r3d",)):
        return True
    return any(name in files for name in METADATA) and any(name in files for name in PHOTOS)


def read_record3d(root: Path, config: SceneConfig) -> Capture:
    """Read an .r3d or an export.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    if root.is_file() or Listing(root).with_suffix((".r3d",)):
        path = the_file(root, ".r3d")
        archive = Archive(path, "metadata")
        meta = read_json_object(path / "metadata", archive.read("metadata"))
        names = {name.removeprefix("rgbd/") for name in archive.names if name.startswith("rgbd/")}
        photos = natural(name for name in names if name.lower().endswith(SUFFIXES))
        folder, source = path / "rgbd", path / "metadata"
    else:
        archive = None
        source = next((root / name for name in METADATA if (root / name).is_file()), root / METADATA[0])
        meta = read_json_object(source)
        folder = next((root / name for name in PHOTOS if (root / name).is_dir()), root / PHOTOS[0])
        photos = natural(name for name in listed(folder) if name.lower().endswith(SUFFIXES))
        names = {f"{Path(name).stem}.exr" for name in listed(root / "depth") if name.endswith(".exr")}
        names |= {name for name in listed(folder) if name.endswith(".depth")}  # of an .r3d that was unpacked
    poses = _poses(meta, source)
    lenses = _lenses(meta, len(poses), source, config)
    if not photos:
        raise InputError(f"{source} has {len(poses)} poses and there are no photos; export the capture again")
    stamps = meta.get("frameTimestamps")
    if isinstance(stamps, list) and len(stamps) != len(poses):
        raise InputError(
            f"{source} has {len(poses)} poses and {len(stamps)} frameTimestamps, so that poses are missing; export the "
            "capture again"
        )
    place = places(photos, len(poses), source, [name for name in names if name.endswith(DEPTHS)])
    shots = []
    for name in photos:
        stem = Path(name).stem
        depth = _depth_map(archive, root, folder, stem, names, meta, source)
        photo = None if archive is None else PhotoBytes(str(folder / name), partial(archive.read, f"rgbd/{name}"))
        lens = lenses[place[name] if len(lenses) > 1 else 0]
        shots.append(Shot(stem, folder / name, poses[place[name]], lens, photo, depth))
    mesh = gt_mesh_in(root) if root.is_dir() else None
    check_no_distortion(meta, source)
    notes = [*note_on(len(photos), len(poses), source), *filter(None, [unknown_keys(meta, KEYS, source)])]
    return Capture(root, "record3d", shots, C2W_OPENGL, gt_mesh=mesh, why="ARKit's poses are metres", notes=notes)


def _poses(meta: dict[str, Any], source: Path) -> list[np.ndarray | Callable[[], np.ndarray]]:
    rows = meta.get("poses")
    if not isinstance(rows, list):
        raise InputError(f"{source} has no list of poses; export the capture again")
    poses: list[np.ndarray | Callable[[], np.ndarray]] = []
    for index, row in enumerate(rows):
        try:
            x, y, z, w, *t = numbers({"poses": row}, "poses", 7, f"{source} (pose {index})")
            poses.append(quaternion_pose(x, y, z, w, t, f"{source} (pose {index})"))
        except InputError as error:
            poses.append(damaged(error))
    return poses


def _lenses(meta: dict[str, Any], count: int, source: Path, config: SceneConfig) -> list:
    """One a frame where autofocus was noted, else one."""
    size = int(number(meta, "w", source)), int(number(meta, "h", source))
    half = config.pixel_centres != "integer"
    every = meta.get("perFrameIntrinsicCoeffs")
    if isinstance(every, list) and every:
        if len(every) not in (1, count):
            raise InputError(
                f"{source} has {count} poses and {len(every)} perFrameIntrinsicCoeffs, so that some are missing; "
                "export the capture again"
            )
        rows = [numbers({"K": row}, "K", 4, f"{source} (perFrameIntrinsicCoeffs)") for row in every]
        return [pinhole_lens(fx, fy, cx, cy, size, source, half) for fx, fy, cx, cy in rows]
    K = intrinsic_matrix(meta, "K", source)
    return [pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], size, source, half)]


def _depth_map(
    archive: Archive | None, root: Path, folder: Path, stem: str, names: set[str], meta: dict[str, Any], source: Path
) -> DepthMap | None:
    if f"{stem}.depth" in names:
        size = int(number(meta, "dw", source)), int(number(meta, "dh", source))
        if not all(0 < side < MAX_SIDE for side in size):
            raise InputError(f"{source} has depth of {size[0]}x{size[1]} pixels; export the capture again")
        path = folder / f"{stem}.depth"
        packed = partial(read_regular, path, MAX_ENTRY_BYTES)
        if archive is not None:
            packed = partial(archive.read, f"rgbd/{stem}.depth")
        return DepthMap(str(path), partial(_packed_depth, packed, path, size), 1.0, stored=size)
    if archive is None and f"{stem}.exr" in names:
        path = root / "depth" / f"{stem}.exr"
        return depth_file(path, 1.0)
    return None


def _packed_depth(packed: Callable[[], bytes], label: Path, size: tuple[int, int]) -> np.ndarray:
    data = unpacked_lzfse(packed(), 4 * size[0] * size[1], str(label))
    return np.frombuffer(data, "<f4").reshape(size[1], size[0])


READER = Reader(is_record3d, read_record3d, LAYOUT)
