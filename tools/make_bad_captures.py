"""Films the demo room badly, in each way that spoils reconstructions, with exact ground truth (ScanNet layout).

    python -m room2dgs.tools.make_bad_captures OUT --frames 24 --width 320 --height 240

Written: OUT/good and OUT/<kind> for each of `KINDS`, the same room and, where the kind is not about it, the same walk;
gt_mesh.ply is what those cameras saw. The same options give the same bytes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.demo_room.capture_files import (
    check_free,
    make_folders,
    write_frame,
    write_intrinsics,
    write_poses,
    write_truth,
)
from room2dgs.demo_room.layout import SIZE, room_patches
from room2dgs.demo_room.light import cast
from room2dgs.demo_room.make import RoomOptions
from room2dgs.demo_room.mesh import visible_mesh
from room2dgs.demo_room.path import camera_path, pose
from room2dgs.demo_room.render import Room, build_room, exposed, pinhole, render, shade
from room2dgs.files import whole_folder
from room2dgs.tools.command_line import command_line

SMALL_STEPS = 0.01  # of the walk's size: a few millimetres from photo to photo
JUMP_STOPS = 1.5
BLUR_PX = (9, 21)  # at 640 pixels of width
PERSON = (0.5, 1.75, 0.9)  # width, height and distance from the room's middle, metres

MIRROR = ((0.7, 0.6), (2.8, 2.1))  # y, z of its corners on the wall x = 0


class Shot(NamedTuple):
    """A photo (H, W, 3) uint8 as it is taken, with its z-depth and camera."""

    photo: np.ndarray
    depth: np.ndarray
    K: np.ndarray
    world_from_cam: np.ndarray
    number: int
    rng: np.random.Generator
    room: Room


Change = Callable[[Shot], np.ndarray]


def small_steps(poses: np.ndarray) -> np.ndarray:
    """Hardly any parallax: the walk's gaze from almost one place."""
    middle = poses[:, :3, 3].mean(axis=0)
    result = poses.copy()
    result[:, :3, 3] = middle + SMALL_STEPS * (poses[:, :3, 3] - middle)
    return result


def turning(poses: np.ndarray) -> np.ndarray:
    """None at all: a camera on a tripod."""
    centre = np.array([*(SIZE[:2] / 2), 1.5])
    return np.stack([pose(centre, yaw, -0.15, 0.0) for yaw in np.linspace(0, 2 * np.pi, len(poses), endpoint=False)])


def blurred(shot: Shot) -> np.ndarray:
    """Every other photo moved while it was taken."""
    if shot.number % 2 == 0:
        return shot.photo
    length, angle = max(3, int(shot.rng.integers(*BLUR_PX) * shot.photo.shape[1] / 640)) | 1, shot.rng.uniform(0, np.pi)
    kernel = np.zeros((length, length), np.float32)
    for part in np.linspace(-1, 1, 8 * length):
        x, y = (round(length // 2 * (1 + part * turn)) for turn in (np.cos(angle), np.sin(angle)))
        kernel[y, x] = 1.0
    return cv2.filter2D(shot.photo, -1, kernel / kernel.sum())


def people(shot: Shot) -> np.ndarray:
    """A patterned figure that stands elsewhere in each photo, and hides what is behind."""
    width, tall, away = PERSON
    angle = 2.4 * shot.number
    foot = np.array([SIZE[0] / 2 + away * np.cos(angle), SIZE[1] / 2 + away * np.sin(angle), 0.0])
    high, wide = shot.depth.shape
    right = np.array([*shot.world_from_cam[:2, 0], 0.0])
    right /= np.linalg.norm(right)
    corners = [foot + side * width / 2 * right + up * np.array([0, 0, tall]) for side, up in _CORNERS]
    seen = (np.array(corners) - shot.world_from_cam[:3, 3]) @ shot.world_from_cam[:3, :3]
    if seen[:, 2].min() < 0.3:
        return shot.photo
    pixel = seen[:, :2] / seen[:, 2:] * (shot.K[0, 0], shot.K[1, 1]) + shot.K[:2, 2]
    cloth = np.random.default_rng(5).integers(0, 255, (14, 4, 3), np.uint8).repeat(10, axis=0).repeat(10, axis=1)
    source = np.array([[0, 140], [40, 140], [40, 0], [0, 0]], np.float32)
    matrix = cv2.getPerspectiveTransform(source, pixel.astype(np.float32))
    drawn = cv2.warpPerspective(cloth, matrix, (wide, high))
    inside = cv2.warpPerspective(np.full(cloth.shape[:2], 255, np.uint8), matrix, (wide, high)) > 127
    before = inside & ((shot.depth == 0) | (shot.depth > seen[:, 2].mean()))
    return np.where(before[..., None], drawn, shot.photo)


def mirror(shot: Shot) -> np.ndarray:
    """A large mirror on a wall; the truth is the wall."""
    high, wide = shot.depth.shape
    x, y = np.meshgrid(np.arange(wide) + 0.5, np.arange(high) + 0.5)
    rays = np.stack([(x - shot.K[0, 2]) / shot.K[0, 0], (y - shot.K[1, 2]) / shot.K[1, 1], np.ones_like(x)], axis=-1)
    directions = rays @ shot.world_from_cam[:3, :3].T
    points = shot.world_from_cam[:3, 3] + shot.depth[..., None] * directions
    (y0, z0), (y1, z1) = MIRROR
    on = (shot.depth > 0) & (points[..., 0] < 0.02)
    on &= (points[..., 1] > y0) & (points[..., 1] < y1) & (points[..., 2] > z0) & (points[..., 2] < z1)
    if not on.any():
        return shot.photo
    begin = (points[on] + [0.02, 0, 0]).astype(np.float32)
    hits = cast(shot.room.scene, begin, (directions[on] * [-1, 1, 1]).astype(np.float32))
    photo = shot.photo.copy()
    photo[on] = exposed(shade(shot.room, hits)[None], 1.0, 0.0, shot.rng)[0]
    return photo


_CORNERS = ((-1, 0), (1, 0), (1, 1), (-1, 1))
FIELD = RoomOptions.fov
# how each kind walks, changes its photos, and jumps in exposure (stops)
KINDS: dict[str, tuple[Callable[[np.ndarray], np.ndarray] | None, Change | None, float]] = {
    "good": (None, None, 0.0),
    "small_steps": (small_steps, None, 0.0),
    "turning": (turning, None, 0.0),
    "exposure": (None, None, JUMP_STOPS),
    "people": (None, people, 0.0),
    "blurred": (None, blurred, 0.0),
    "mirror": (None, mirror, 0.0),
}


def make_bad_capture(out: Path, kind: str, options: RoomOptions, room: Room | None = None) -> Path:
    """Writes one of `KINDS`; it appears at `out` only when it is complete.

    Raises:
        InputError: `out` holds something.
    """
    check_free(out, False)
    walk, change, stops = KINDS[kind]
    room = room or build_room(room_patches(options.seed, options.blank_walls), options.seed)
    poses = camera_path(options.frames, room.distance, np.random.default_rng([options.seed, 4]), options.frames_a_lap)
    poses = walk(poses) if walk else poses
    K = pinhole(options.width, options.height, FIELD)
    gains = 2.0 ** np.random.default_rng([options.seed, 7]).uniform(-stops, stops, options.frames)
    with whole_folder(out) as partial:
        make_folders(partial)
        for index, world_from_cam in enumerate(poses):
            color, depth = render(room, K, world_from_cam, options.width, options.height, options.gloss)
            photo = exposed(color, gains[index], options.noise, np.random.default_rng([options.seed, 5, index]))
            if change is not None:
                rng = np.random.default_rng([options.seed, 8, index])
                photo = change(Shot(photo, depth, K, world_from_cam, index, rng, room))
            write_frame(partial, index, photo, depth, options.jpeg_quality)
        write_poses(partial / "pose", poses)
        write_intrinsics(partial, K)
        truth = visible_mesh(room, room.patches, K, poses, options.width, options.height)
        write_truth(partial, truth, {"kind": kind, **asdict(options)})
    return out


@command_line("make_bad_captures")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="make_bad_captures", description="Film the demo room badly, in each way.")
    parser.add_argument("out", type=Path, help="folder to write")
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--height", type=int, default=240)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    given = parser.parse_args(arguments)
    options = RoomOptions(seed=given.seed, frames=given.frames, width=given.width, height=given.height)
    options = replace(options, frames_a_lap=max(4, min(options.frames_a_lap, given.frames)))
    given.out.mkdir(parents=True, exist_ok=True)
    room = build_room(room_patches(options.seed, options.blank_walls), options.seed)
    for kind in given.kinds:
        print(make_bad_capture(given.out / kind, kind, options, room))


if __name__ == "__main__":
    sys.exit(main())
