"""SDFStudio: meta_data.json: camtoworld (OpenCV axes), intrinsics, and worldtogt, which leads out of its unit cube."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Capture, Shot, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, inside, natural
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.text_files import number, numbers, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "meta_data.json (SDFStudio)"


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
    frames = meta.get("frames")
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise InputError(f"{path} has no list of frames; write the file again")
    shots = {}
    for frame in frames:
        name = frame.get("rgb_path")
        if not isinstance(name, str):
            raise InputError(f"{path} has a frame without rgb_path; write the file again")
        K = numbers(frame, "intrinsics", 16, path).reshape(4, 4)
        lens = pinhole_lens(K[0, 0], K[1, 1], K[0, 2], K[1, 2], size, path, config.pixel_centres == "half")
        depth, mask = frame.get("sensor_depth_path"), frame.get("foreground_mask")
        shots[name] = Shot(
            name,
            inside(root, name, path),
            numbers(frame, "camtoworld", 16, path).reshape(4, 4),
            lens,
            depth=depth_file(inside(root, depth, path), scale) if isinstance(depth, str) and depth else None,
            mask=PhotoFile(inside(root, mask, path)) if isinstance(mask, str) and mask else None,
        )
    return Capture(
        root,
        "sdfstudio",
        [shots[name] for name in natural(shots)],
        metric=world is not None,
        why="worldtogt leads to the true mesh's frame" if world is not None else "meta_data.json has no worldtogt",
        world_from_disk=world,
        gt_mesh=gt_mesh_in(root, "*_mesh.ply"),
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
