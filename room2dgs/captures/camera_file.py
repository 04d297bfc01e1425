"""Cameras without photos, from a transforms.json or a folder with a COLMAP model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.capture import C2W_OPENGL, W2C_OPENCV, Poses, file_name, pose_in_world, world_from_cam
from room2dgs.captures.colmap_model import is_model, read_model
from room2dgs.captures.lens import Lens, pinhole_of
from room2dgs.captures.matrix_files import rigid
from room2dgs.captures.readers.nerfstudio import capture_world, shots_of
from room2dgs.captures.text_files import read_json_object
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.poses import inverse_pose


def read_cameras(path: Path) -> list[tuple[str, Camera]]:
    """Names and cameras, in the file's order; of a distorted lens its pinhole image.

    Args:
        path: a .json as nerfstudio writes it (camera-to-world, OpenGL axes, metres of the run's world), with w, h and a
            focal length; or a folder with cameras and images of COLMAP, text or binary.

    Raises:
        InputError: neither, damaged, or without a camera.
    """
    if path.is_file() and path.suffix.lower() == ".json":
        found = _of_transforms(path)
    elif path.is_dir() and is_model(path):
        found = _of_model(path)
    else:
        raise InputError(f"{path} is no camera file; give a transforms.json or a folder with a COLMAP model")
    if not found:
        raise InputError(f"{path} has no camera; add one")
    return found


def _of_transforms(path: Path) -> list[tuple[str, Camera]]:
    meta = read_json_object(path)
    frames = meta.get("frames")
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise InputError(f"{path} has no list of frames; write the file again")
    for index, frame in enumerate(frames):
        if not ({"w", "h"} <= {*meta, *frame}):
            raise InputError(f"{path} does not say w and h of frame {index}; add the size of the pictures in pixels")
        frame.setdefault("file_path", f"{index:06d}")
    world = capture_world(meta, path)
    found = []
    for shot in shots_of(meta, frames, path, lambda name: path.parent / name):
        if shot.lens is None:
            raise InputError(f"{path} says no focal length of {shot.name}; add fl_x, fl_y or camera_angle_x")
        read = shot.pose() if callable(shot.pose) else shot.pose
        assert read is not None, f"{path} names frame {shot.name} without a pose"
        pose = _finite(read, f"frame {shot.name}", path)
        pose = rigid(pose, f"{path} (frame {shot.name})")
        found.append((shot.name, _camera(pose, C2W_OPENGL, shot.lens, world)))
    return [(file_name(name), camera) for name, camera in found]


def _of_model(path: Path) -> list[tuple[str, Camera]]:
    model = read_model(path)
    return [
        (
            file_name(image.name),
            _camera(
                _finite(image.cam_from_world, f"image {image.name}", path), W2C_OPENCV, model.cameras[image.camera]
            ),
        )
        for image in model.images
    ]


def _finite(pose: np.ndarray, what: str, path: Path) -> np.ndarray:
    """Here each camera was asked for, so none is left out."""
    if not np.isfinite(pose).all():
        raise InputError(f"{path} has no usable pose of {what}; write the pose again or delete it")
    return pose


def _camera(pose: np.ndarray, poses: Poses, lens: Lens, world: np.ndarray | None = None) -> Camera:
    where = world_from_cam(pose, poses)
    pinhole = pinhole_of(lens) if lens.distorts else None
    K, (width, height) = (lens.K, lens.known_size) if pinhole is None else (pinhole.K, pinhole.size)
    return Camera(K, width, height, inverse_pose(where if world is None else pose_in_world(where, world)))
