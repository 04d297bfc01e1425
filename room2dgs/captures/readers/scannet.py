"""The ScanNet layout: color/<i>.jpg, depth/<i>.png, pose/<i>.txt, intrinsic/*.txt.

Poses on disk are camera-to-world in metres with OpenCV axes. Depth is 16-bit millimetres, registered to the
photos, and optional. One set of intrinsics serves all photos; its cx, cy count pixel centres at integers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Shot, lost, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.image_files import color_size, depth_size
from room2dgs.captures.known_keys import unknown_keys
from room2dgs.captures.left_out import some
from room2dgs.captures.listing import PHOTO_SUFFIXES, Listing, gt_mesh_in, listed, natural
from room2dgs.captures.matrix_files import read_intrinsics, read_matrix, read_world_from_cam
from room2dgs.captures.pairing import alike
from room2dgs.captures.principal_point import check_principal_point
from room2dgs.captures.reader import Reader
from room2dgs.captures.shapes import MAX_MISMATCH
from room2dgs.captures.text_files import key_values, number, numbers, positive
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

FOLDERS = ("color", "pose", "intrinsic")
LAYOUT = "color/<i>.jpg, pose/<i>.txt and intrinsic/intrinsic_color.txt"
# keys of _info.txt; the extrinsics lead from a camera to itself
INFO = frozenset(
    f"m_{key}"
    for key in (
        *("versionNumber", "sensorName", "colorWidth", "colorHeight", "depthWidth", "depthHeight", "depthShift"),
        *("calibrationColorIntrinsic", "calibrationColorExtrinsic", "calibrationDepthIntrinsic"),
        *("calibrationDepthExtrinsic", "frames.size"),
    )
)
SAME_PLACE = 1e-3  # metres and parts of a rotation


def is_scannet(files: Listing) -> bool:
    """Two of the three folders (the third is then missed by name), also under frames/; or what a C++ export has."""
    places = [sum(f"{place}{name}" in files for name in FOLDERS) for place in ("", "frames/")]
    return max(places) >= 2 or "_info.txt" in files


def read_scannet(root: Path, config: SceneConfig) -> Capture:
    """Read a folder in ScanNet's layout.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    if (root / "_info.txt").is_file():
        return read_flat(root, config)
    folder = root / "frames" if not (root / "color").is_dir() and (root / "frames" / "color").is_dir() else root
    for name in FOLDERS:
        if not (folder / name).is_dir():
            raise InputError(f"{folder / name} is missing; a capture in this layout has {LAYOUT}")
    path = folder / "intrinsic" / "intrinsic_color.txt"
    K = read_intrinsics(path)
    lens = pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], None, path, config.pixel_centres == "half")
    photos, notes = _photos(folder / "color")
    names = [photo.name for _, photo in photos]
    depths = alike(names, [name for name in listed(folder / "depth") if name.lower().endswith(".png")])
    poses = alike(names, [name for name in listed(folder / "pose") if name.endswith(".txt")])
    shots = [
        Shot(
            f"{index:06d}",
            photo,
            _pose(folder / "pose", photo, poses),
            lens,
            depth=folder / "depth" / depths[photo.name] if photo.name in depths else None,
        )
        for index, photo in photos
    ]
    first = next((shot for shot in shots if isinstance(shot.depth, Path) and depth_size(shot.depth)), None)
    if first and (folder / "intrinsic" / "intrinsic_depth.txt").exists():
        _check_registered(folder / "intrinsic" / "intrinsic_depth.txt", K, first)
    warnings = _extrinsics(folder / "intrinsic") if first else []
    return Capture(
        root,
        "scannet",
        shots,
        gt_mesh=scannet_mesh(root),
        why="ScanNet's poses are metres",
        notes=notes,
        warnings=warnings,
    )


def _extrinsics(folder: Path) -> list[str]:
    color, depth = (folder / f"extrinsic_{name}.txt" for name in ("color", "depth"))
    if not (color.is_file() and depth.is_file()):
        return []
    try:
        return not_registered(read_matrix(color), read_matrix(depth), depth)
    except InputError as error:
        return [f"extrinsics are not used: {error}"]


def _pose(folder: Path, photo: Path, names: dict[str, str]) -> Callable[[], np.ndarray]:
    if photo.name not in names:
        return lost(f"{folder.name}/{photo.stem}.txt is missing")
    return partial(read_world_from_cam, folder / names[photo.name])


def scannet_mesh(root: Path) -> Path | None:
    """The true surface beside a scan."""
    return gt_mesh_in(root, "*_vh_clean_2.ply", "*_vh_clean.ply") or gt_mesh_in(
        root.parent, f"{root.name}_vh_clean_2.ply", f"{root.name}_vh_clean.ply", own=False
    )


def _photos(folder: Path) -> tuple[list[tuple[int, Path]], list[str]]:
    """(index, path) of every photo, in numerical order; and a note on photos of other names."""
    photos: dict[int, Path] = {}
    other: list[str] = []
    for name in sorted(listed(folder)):
        path = folder / name
        if path.suffix.lower() not in PHOTO_SUFFIXES:
            continue
        if not (path.stem.isascii() and path.stem.isdigit()):
            other.append(name)
            continue
        index = int(path.stem)
        if index in photos:
            raise InputError(f"{path} and {photos[index].name} are the same frame; delete one of them")
        photos[index] = path
    if not photos:
        raise InputError(f"{folder} has no photos; name them <number>.jpg or <number>.png")
    message = f"{folder} has {len(other)} photos whose names are no numbers, which are not used: {some(other)}"
    return sorted(photos.items()), [message] if other else []


def _check_registered(path: Path, K: np.ndarray, first: Shot) -> None:
    """Both cameras must be the same up to image size: a depth map is resized to its photo, never warped."""
    assert isinstance(first.depth, Path) and first.lens is not None
    K_depth, size, depth = read_intrinsics(path), color_size(first.path), depth_size(first.depth)
    assert depth is not None
    check_principal_point(replace(first.lens, size=size))  # says more if it is the photos' intrinsics that are wrong
    scale = np.diag(np.array([size[0] / depth[0], size[1] / depth[1], 1.0]))
    error = np.abs((scale @ K_depth - K)[:2]) / np.array([[K[0, 0]], [K[1, 1]]])
    if error.max() > MAX_MISMATCH:
        raise InputError(
            f"{path} is another camera than intrinsic_color.txt; register depth to colour or delete the depth folder"
        )


def not_registered(color: np.ndarray, depth: np.ndarray, label: object) -> list[str]:
    """A warning where calibration has the depth camera in another place than the photos'.

    Args:
        color, depth: (4, 4) extrinsics; zeros or what is not finite say nothing.
    """
    try:
        apart = np.linalg.inv(color) @ depth
    except np.linalg.LinAlgError:
        return []
    if not np.isfinite(apart).all() or np.abs(apart - np.eye(4)).max() < SAME_PLACE:
        return []
    return [
        f"{label} puts the depth camera {1000 * np.linalg.norm(apart[:3, 3]):.0f} mm from the photos' (extrinsics); "
        "depth is taken as registered to the photos, so register it, or delete it if it is not"
    ]


def read_flat(root: Path, config: SceneConfig) -> Capture:
    """Read what the C++ reader of .sens writes: frame-000000.{color.jpg,depth.png,pose.txt} and _info.txt."""
    path = root / "_info.txt"
    known = key_values(path)
    size = int(number(known, "m_colorWidth", path)), int(number(known, "m_colorHeight", path))
    K = numbers(known, "m_calibrationColorIntrinsic", 16, path).reshape(4, 4)
    unknown = unknown_keys(known, INFO, path)
    shift = positive(known, "m_depthShift", path, 1000.0)
    lens = pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], size, path, config.pixel_centres == "half")
    names = listed(root)
    shots = []
    for name in natural(name for name in names if ".color." in name):
        stem = name.partition(".color.")[0]
        map_name = next((f"{stem}.depth{end}" for end in (".png", ".pgm") if f"{stem}.depth{end}" in names), None)
        pose = f"{stem}.pose.txt"
        shots.append(
            Shot(
                stem,
                root / name,
                partial(read_world_from_cam, root / pose) if pose in names else lost(f"{pose} is missing"),
                lens,
                depth=depth_file(root / map_name, 1.0 / shift) if map_name else None,
            )
        )
    if not shots:
        raise InputError(f"{root} has no photos; a capture with _info.txt has frame-000000.color.jpg and so on")
    notes = [unknown] if unknown else []
    color, depth = (
        numbers(known, key, 16, path).reshape(4, 4) if key in known else np.eye(4)
        for key in ("m_calibrationColorExtrinsic", "m_calibrationDepthExtrinsic")
    )
    return Capture(
        root,
        "scannet",
        shots,
        gt_mesh=scannet_mesh(root),
        why="ScanNet's poses are metres",
        notes=notes,
        warnings=not_registered(color, depth, path) if any(shot.depth for shot in shots) else [],
    )


READER = Reader(is_scannet, read_scannet, LAYOUT)
