"""A made capture's files in the ScanNet layout: what the makers of rooms share.

color/<i>.jpg, depth/<i>.png (16-bit millimetres, z-depth at the pixel's centre, 0 = a light), pose/<i>.txt
(camera-to-world, metres, OpenCV axes), intrinsic/intrinsic_{color,depth}.txt (4x4, pixel centres at integers as in
ScanNet), gt_mesh.ply and room.json (the options).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import trimesh

from room2dgs.errors import InputError

FOLDERS = ("color", "depth", "pose", "intrinsic")
MESH, OPTIONS = "gt_mesh.ply", "room.json"
CONTENT = {*FOLDERS, MESH, OPTIONS}
MILLIMETRES = 2**16 - 1  # the largest depth that a file holds; what is farther becomes 0


def check_free(out: Path, overwrite: bool, content: set[str] | None = None) -> None:
    """Raises InputError if writing to `out` would replace something that is no capture."""
    content = content or CONTENT
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InputError(f"{out} is not a folder; choose another name")
    names = {path.name for path in out.iterdir()} if out.exists() else set()
    if names and not overwrite:
        raise InputError(f"{out} is not empty; choose another folder or add --overwrite")
    if names - content:
        raise InputError(
            f"{out} holds {sorted(names - content)[0]}, which is not part of a room; choose another folder"
        )


def check_limits(options: object, limits: Mapping[str, tuple[float, float]]) -> None:
    """Raises InputError for an option out of its range."""
    for name, (low, high) in limits.items():
        value = getattr(options, name)
        if not low <= value <= high:
            raise InputError(f"{name} is {value}; give a value from {low} to {high}")


def write_frame(out: Path, index: int, photo: np.ndarray, depth: np.ndarray, jpeg_quality: int) -> None:
    """Writes a photo (H, W, 3) uint8 RGB and its z-depth (H, W) in metres."""
    millimetres = np.round(1000 * depth)
    millimetres = np.where(millimetres <= MILLIMETRES, millimetres, 0).astype(np.uint16)
    write_image(out / f"color/{index}.jpg", photo[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])
    write_image(out / f"depth/{index}.png", millimetres, [])


def write_poses(folder: Path, poses: np.ndarray) -> None:
    """Writes world_from_cam (F, 4, 4) as <i>.txt."""
    folder.mkdir(exist_ok=True)
    for index, world_from_cam in enumerate(poses):
        np.savetxt(folder / f"{index}.txt", world_from_cam, fmt="%.9f")


def write_intrinsics(out: Path, K: np.ndarray) -> None:
    """Writes K (3, 3), pixel centres at +0.5, of both cameras."""
    on_disk = np.eye(4)
    on_disk[:3, :3] = K
    on_disk[:2, 2] -= 0.5  # ScanNet counts pixel centres at integers
    for name in ("color", "depth"):
        np.savetxt(out / f"intrinsic/intrinsic_{name}.txt", on_disk, fmt="%.9f")


def write_truth(out: Path, mesh: trimesh.Trimesh, options: dict[str, object]) -> None:
    """Writes the ground-truth mesh and the options."""
    data = mesh.export(file_type="ply")
    assert isinstance(data, bytes)
    (out / MESH).write_bytes(data)
    (out / OPTIONS).write_text(json.dumps(options, indent=1) + "\n")


def make_folders(out: Path) -> None:
    """Makes the empty folders of a capture."""
    for folder in FOLDERS:
        (out / folder).mkdir()


def exposure_gains(frames: int, drift: float, rng: np.random.Generator) -> np.ndarray:
    """(frames,) factors of the exposure: a slow wander, its extreme `drift` stops from 1."""
    time = np.linspace(0, 2 * np.pi, frames)
    phase = rng.uniform(0, 2 * np.pi, 3)
    wander = np.sin(time + phase[0]) + 0.5 * np.sin(2.3 * time + phase[1]) + 0.25 * np.sin(5.1 * time + phase[2])
    return 2.0 ** (drift * wander / np.abs(wander).max())


def write_image(path: Path, image: np.ndarray, parameters: list[int]) -> None:
    """Encodes by the name's ending; a full disk raises OSError, where cv2.imwrite only returns False."""
    encoded = cv2.imencode(path.suffix, image, parameters)[1]
    path.write_bytes(encoded.tobytes())
