"""Makes photos of random rooms with exact depth and normals, to train the prior network on.

    python -m room2dgs.tools.make_prior_data OUT --rooms 1200

A shard is a folder of .npy files of VIEWS photos of each of ROOMS rooms:
    radiance.npy (N, H, W, 3) uint8, see `encoded`;
    depth.npy    (N, H, W) float16, z-depth in metres, 0 = a light or outside;
    normal.npy   (N, H, W, 3) int8, 127 x unit normals, OpenCV camera axes, facing the camera, 0 as for depth;
    focal.npy    (N,) float32, pixels; the principal point is the image's middle.
The same options give the same bytes; shards that are there already are kept.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from rich.progress import track

from room2dgs.errors import InputError
from room2dgs.files import whole_folder
from room2dgs.tools.command_line import command_line
from room2dgs.tools.random_rooms.cameras import random_views
from room2dgs.tools.random_rooms.layout import random_room
from room2dgs.tools.random_rooms.render import light_up, render

ROOMS = 8  # a shard
VIEWS = 8  # a room
WIDTH, HEIGHT = 320, 240
BRIGHTEST = 4.0  # radiance that is stored as 255
GAMMA = 2.2
MAX_DEPTH_M = 60.0


def encoded(radiance: np.ndarray) -> np.ndarray:
    """uint8 of linear radiance (1 = white at a gain of 1): 255 (L / 4)^(1 / 2.2)."""
    return np.round(255 * np.clip(radiance / BRIGHTEST, 0, 1) ** (1 / GAMMA)).astype(np.uint8)


def room_photos(seed: int, number: int) -> dict[str, np.ndarray]:
    """The photos of one room, as a shard keeps them."""
    room = random_room(np.random.default_rng([seed, number, 0]))
    lit = light_up(room.patches, np.random.default_rng([seed, number, 1]))
    views = random_views(room, lit.distance, np.random.default_rng([seed, number, 2]), VIEWS)
    rows: dict[str, list] = {"radiance": [], "depth": [], "normal": [], "focal": []}
    for index, (fov, world_from_cam) in enumerate(views):
        focal = WIDTH / 2 / np.tan(np.radians(fov) / 2)
        view = render(lit, focal, world_from_cam, WIDTH, HEIGHT, np.random.default_rng([seed, number, 3, index]))
        rows["radiance"].append(encoded(view.radiance))
        rows["depth"].append(np.where(view.depth < MAX_DEPTH_M, view.depth, 0).astype(np.float16))
        rows["normal"].append(np.round(127 * view.normal).astype(np.int8))
        rows["focal"].append(np.float32(focal))
    return {name: np.stack(values) for name, values in rows.items()}


def write_shard(out: Path, seed: int, number: int) -> None:
    """Writes the folder `shard_<number>` of `out`, whole or not at all; keeps one that is there."""
    folder = out / f"shard_{number:05d}"
    if folder.is_dir():
        return
    rooms = [room_photos(seed, number * ROOMS + room) for room in range(ROOMS)]
    with whole_folder(folder) as unfinished:
        for name in rooms[0]:
            np.save(unfinished / f"{name}.npy", np.concatenate([room[name] for room in rooms]))


@command_line("make_prior_data")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="make_prior_data",
        description="Make photos of random rooms with exact depth and normals.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("out", type=Path, help="folder of shards")
    parser.add_argument("--rooms", type=int, default=1200, help=f"rooms in all, {ROOMS} a shard")
    parser.add_argument("--seed", type=int, default=0, help="fixes everything")
    parser.add_argument("--first", type=int, default=0, help="number of the first shard")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    options = parser.parse_args(arguments)
    if options.out.exists() and not options.out.is_dir():
        raise InputError(f"{options.out} is not a folder; choose another name")
    if options.rooms < 1 or options.workers < 1:
        raise InputError("--rooms and --workers are at least 1")
    options.out.mkdir(parents=True, exist_ok=True)
    numbers = range(options.first, options.first + -(-options.rooms // ROOMS))
    write = partial(write_shard, options.out, options.seed)
    if options.workers == 1:
        for number in track(numbers, "shards"):
            write(number)
    else:
        with ProcessPoolExecutor(options.workers) as pool:
            for _ in track(pool.map(write, numbers), "shards", total=len(numbers)):
                pass


if __name__ == "__main__":
    sys.exit(main())
