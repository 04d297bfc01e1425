"""SDFStudio: meta_data.json: camtoworld (OpenCV axes), intrinsics, and worldtogt, which leads out of its unit cube."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.capture import Capture, Shot, damaged, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.known_keys import DISTORTION, check_no_distortion, unknown_in, unknown_keys
from room2dgs.captures.left_out import left_out
from room2dgs.captures.listing import Listing, gt_mesh_in, inside, natural
from room2dgs.captures.named_maps import without_missing_maps
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import number, numbers, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.texts import shown

LAYOUT = "meta_data.json (SDFStudio)"
PINHOLES = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")  # camera_model of a K without distortion
KEYS = {
    *DISTORTION,
    *("height", "width", "worldtogt", "frames"),
    # what the data's loader reads and no camera needs
    *("camera_model", "scene_box", "pairs", "has_mono_prior", "has_sensor_depth", "has_foreground_mask"),
    *("has_sparse_sfm_points", "scene_box_radius", "sfm_sparse_points_view", "pairs_path"),
}
FRAME_KEYS = {
    *DISTORTION,
    *("rgb_path", "camtoworld", "intrinsics", "sensor_depth_path", "foreground_mask"),
    *("mono_depth_path", "mono_normal_path", "sfm_sparse_points_view", "segmentation_path"),
    *("label_path", "group_path"),
}


def is_sdfstudio(files: Listing) -> bool:
    return "meta_data.json" in files


def read_sdfstudio(root: Path, config: SceneConfig) -> Capture:
    """Read a meta_data.json.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path = root / "meta_data.json"
    meta = read_json_object(path)
    size = int(number(meta, "width", path)), int(number(meta, "height", path))
    world, scale = _world(meta, path)
    check_no_distortion(meta, path)
    model = meta.get("camera_model", PINHOLES[0])
    if str(model).upper() not in PINHOLES:
        raise InputError(
            f"{path} has camera_model {shown(str(model), 40)!r}, and K alone is read; undistort the photos"
        )
    frames = meta.get("frames")
    if not isinstance(frames, list) or not frames:
        raise InputError(f"{path} has no list of frames; write the file again")
    shots, bad = {}, {}
    for index, frame in enumerate(frames):
        try:
            shot = _shot(frame, f"{path} frame {index}", root, size, scale, config)
            if shot.name in shots:
                raise InputError(f"{path} frame {index} names {shot.name} a second time; write the file again")
            shots[shot.name] = shot
        except InputError as error:
            bad[f"frame {index}"] = str(error)
    message = left_out(bad, len(frames), f"frames of {path.name}")
    notes = [message, unknown_keys(meta, KEYS, path), unknown_in(frames, FRAME_KEYS, f"frames of {path}")]
    found, warnings = without_missing_maps([shots[name] for name in natural(shots)], path)
    return Capture(
        root,
        "sdfstudio",
        found,
        metric=world is not None,
        why="worldtogt leads to the true mesh's frame" if world is not None else "meta_data.json has no worldtogt",
        world_from_disk=world,
        gt_mesh=gt_mesh_in(root, "*_mesh.ply"),
        notes=[note for note in notes if note],
        warnings=warnings,
    )


def _shot(frame: Any, label: str, root: Path, size: tuple[int, int], scale: float, config: SceneConfig) -> Shot:
    """A frame's photo; with damage in place of a pose where only its name and path are good.

    Raises:
        InputError: these are not.
    """
    name = frame.get("rgb_path") if isinstance(frame, dict) else None
    if not isinstance(name, str):
        raise InputError(f"{label} has no rgb_path; write the file again")
    path = inside(root, name, label)
    try:
        check_no_distortion(frame, label)
        pose = numbers(frame, "camtoworld", 16, label).reshape(4, 4)
        K = numbers(frame, "intrinsics", 16, label).reshape(4, 4)
        lens = pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], size, label, config.pixel_centres == "half")
        depth, mask = (
            inside(root, frame[key], label) if isinstance(frame.get(key), str) and frame[key] else None
            for key in ("sensor_depth_path", "foreground_mask")
        )
    except InputError as error:
        return Shot(name, path, damaged(error), None)
    return Shot(
        name,
        path,
        pose,
        lens,
        depth=depth_file(depth, scale) if depth else None,
        mask=PhotoFile(mask) if mask else None,
    )


def _world(meta: dict, path: Path) -> tuple[np.ndarray | None, float]:
    """(4, 4) out of the unit cube, and its scale."""
    if meta.get("worldtogt") is None:
        return None, 1.0
    world = numbers(meta, "worldtogt", 16, path).reshape(4, 4)
    linear = world[:3, :3]
    determinant = np.linalg.det(linear) if np.isfinite(world).all() else 0.0
    if determinant <= 0:
        raise InputError(f"{path} has a worldtogt that mirrors or flattens; write it again")
    scale = float(np.cbrt(determinant))
    if np.abs(linear.T @ linear / scale**2 - np.eye(3)).max() > 1e-3:
        raise InputError(f"{path} has a worldtogt that is no rotation with one scale; write it again")
    return world, scale


READER = Reader(is_sdfstudio, read_sdfstudio, LAYOUT)
