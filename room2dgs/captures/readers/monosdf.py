"""MonoSDF's preprocessed scans: 000000_rgb.png, cameras.npz (world_mat_<i>, scale_mat_<i>).

world_mat is K times world-to-camera, in metres, of the photo with the number <i>; scale_mat, which leads to a unit
sphere, is not applied.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.capture import Capture, Shot, damaged, lost, pinhole_lens
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural, photos_in
from room2dgs.captures.matrix_files import rigid
from room2dgs.captures.pairing import note_on, places
from room2dgs.captures.reader import Reader
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE
from room2dgs.regular_files import check_regular

LAYOUT = "000000_rgb.png and cameras.npz (MonoSDF, NeuS)"
FOLDERS = ("image", "images", "rgb")
MAX_ENTRIES, MAX_ENTRY_BYTES = 200_000, 1 << 16


def is_monosdf(files: Listing) -> bool:
    return "cameras.npz" in files or "cameras_sphere.npz" in files


def read_monosdf(root: Path, config: SceneConfig) -> Capture:
    """Read a scan.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path = next((p for p in (root / "cameras.npz", root / "cameras_sphere.npz") if p.is_file()), root / "cameras.npz")
    matrices = _matrices(path)
    folder, photos = root, natural(name for name in listed(root) if name.endswith("_rgb.png"))
    for name in FOLDERS:
        if not photos and (root / name).is_dir():
            folder, photos = root / name, photos_in(root / name)
    if not photos:
        raise InputError(f"{root} has no photos; they are called 000000_rgb.png or lie in image/")
    # photos in a folder may be called anyhow, 000000_rgb.png is world_mat_0's
    keys = {_number(key) for key in matrices} - {-1}
    place = places(photos, 1 + max(keys, default=-1), path, from_zero=folder == root, keyed=True, keys=keys)
    shots = []
    for name in photos:
        stem = name.removesuffix("_rgb.png") if folder == root else name
        key = f"world_mat_{place[name]}"
        if key not in matrices:
            shots.append(Shot(stem, folder / name, lost(f"{path.name} has no {key}"), None))
            continue
        try:
            K, pose = decomposed(matrices[key], f"{path} ({key})")
            lens = pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], None, path, config.pixel_centres == "half")
            shots.append(Shot(stem, folder / name, pose, lens))
        except InputError as error:
            shots.append(Shot(stem, folder / name, damaged(error), None))
    notes = note_on(sum(f"world_mat_{place[name]}" in matrices for name in photos), len(matrices), path)
    return Capture(
        root, "monosdf", shots, gt_mesh=gt_mesh_in(root, "*_mesh.ply"), why="world_mat is in metres", notes=notes
    )


def _number(key: str) -> int:
    """The <i> of world_mat_<i>; -1: it has none."""
    text = key.removeprefix("world_mat_")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 9 else -1


def decomposed(world_mat: np.ndarray, label: str) -> tuple[np.ndarray, np.ndarray]:
    """K (3, 3) and camera-to-world (4, 4) of a projection K [R | t].

    Raises:
        InputError: it is none.
    """
    numeric = world_mat.dtype.kind in "fiu"
    if not numeric or world_mat.shape not in ((3, 4), (4, 4)) or not np.isfinite(world_mat[:3]).all():
        raise InputError(f"{label} is no finite 4x4 matrix; copy the scan again")
    projection = world_mat[:3].astype(np.float64)
    if abs(np.linalg.det(projection[:, :3])) < 1e-9:
        raise InputError(f"{label} projects nothing; copy the scan again")
    projection = projection * np.sign(np.linalg.det(projection[:, :3]))
    K, rotation, centre = cv2.decomposeProjectionMatrix(projection)[:3]
    pose = np.eye(4)
    pose[:3, :3] = rotation.T
    pose[:3, 3] = (centre[:3] / centre[3])[:, 0]
    K = K / K[2, 2]
    if abs(K[0, 1]) > 1e-3 * K[0, 0]:
        raise InputError(f"{label} has skewed pixels, which no camera here has; copy the scan again")
    return K, rigid(pose, label)


def _matrices(path: Path) -> dict[str, np.ndarray]:
    """The small arrays of an archive; what is larger than a matrix is not unpacked."""
    check_regular(path, "copy the scan again")
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
        if len(entries) > MAX_ENTRIES or any(entry.file_size > MAX_ENTRY_BYTES for entry in entries):
            raise InputError(f"{path} holds more than matrices; copy the scan again")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files if name.startswith("world_mat_")}
    except NUMPY_DAMAGE as error:
        raise InputError(f"{path} cannot be read as an .npz of matrices; copy the scan again") from error


READER = Reader(is_monosdf, read_monosdf, LAYOUT)
