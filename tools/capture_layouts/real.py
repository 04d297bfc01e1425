"""Some frames of a real capture as a scene whose every number is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.read import placed
from room2dgs.captures.scene import Frame
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.made import Made

POINTS = 3000  # of all photos together
SAME_DEPTH = 0.01  # of the distance: a photo sees a point that lies where its depth says


def made_of(capture: Path, first: int, count: int, step: int) -> Made:
    """`count` photos from the `first` on, every `step`-th, with their files' own bytes if those are JPEG.

    Sparse points are places that the depth maps measure.

    Raises:
        InputError: too few frames, no depth, distorted photos or photos of several sizes.
    """
    scene = placed(replace(load_config([f"scene.path={capture}", "out=unused"]).scene, test_every=0, split="every"))
    frames = scene.train[first::step][:count]
    if len(frames) < count:
        raise InputError(f"{capture} has {len(scene.train)} frames, too few for {count} of them; lower --frames")
    K = frames[0].camera.K
    alike = all(np.array_equal(frame.camera.K, K) and frame.lens is None for frame in frames)
    if not alike or any(frame.depth_path is None for frame in frames):
        raise InputError(f"{capture} has to have one camera without distortion, and depth; take another capture")
    photos = np.stack([frame.color()[..., ::-1] for frame in frames])
    depths = np.stack([_millimetres(frame) for frame in frames])
    jpegs = None
    if all(frame.photo is None and frame.color_path.suffix.lower() in (".jpg", ".jpeg") for frame in frames):
        jpegs = tuple(frame.color_path.read_bytes() for frame in frames)
    poses = np.stack([frame.camera.world_from_cam for frame in frames])
    xyz, rgb = _points(frames, depths, photos)
    seen = [_seen(frame, xyz, depth / 1000) for frame, depth in zip(frames, depths, strict=True)]
    size = frames[0].camera.size
    return Made(K, size, poses, photos, depths, xyz, rgb, seen, jpegs, np.full(size[::-1], 255, np.uint8))


def _millimetres(frame: Frame) -> np.ndarray:
    depth = frame.depth()
    assert depth is not None
    return np.round(1000 * depth).astype(np.uint16)


def _points(frames: tuple[Frame, ...], depths: np.ndarray, photos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    xyz, rgb = [], []
    for frame, depth, photo in zip(frames, depths, photos, strict=True):
        row, column = np.nonzero(depth)
        chosen = random.choice(len(row), min(len(row), max(1, POINTS // len(frames))), replace=False)
        row, column = row[chosen], column[chosen]
        K, z = frame.camera.K, depth[row, column] / 1000
        at = np.stack([(column + 0.5 - K[0, 2]) / K[0, 0] * z, (row + 0.5 - K[1, 2]) / K[1, 1] * z, z], axis=1)
        pose = frame.camera.world_from_cam
        xyz.append(at @ pose[:3, :3].T + pose[:3, 3])
        rgb.append(cv2.cvtColor(photo[row, column][None], cv2.COLOR_BGR2RGB)[0])
    return np.concatenate(xyz), np.concatenate(rgb)


def _seen(frame: Frame, xyz: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    pixel, z = frame.camera.project(xyz)
    index = np.flatnonzero(frame.camera.in_view(xyz))
    column, row = np.floor(pixel[index]).astype(int).T
    index = index[np.abs(depth[row, column] / z[index] - 1) < SAME_DEPTH]
    return index, pixel[index]
