"""Films random rooms as hand-held walks with exact ground truth, in the ScanNet layout: a suite to tune on.

    python -m room2dgs.tools.make_captures OUT --rooms 8 --seed 9000
    python -m room2dgs.tools.make_captures OUT --rooms 8 --phone
    python -m room2dgs.tools.make_captures OUT --rooms 8 --phone wander,blur
    python -m room2dgs.tools.make_captures OUT --rooms 8 --mirrors 1

Written: OUT/room_00, room_01, ..., each as `capture_files` says, with the noise of lens and sensor on the photos;
gt_mesh.ply is only what the cameras saw; plan_true.json has the outline, the openings and the tops of tables of the
whole room (`truth`). With --mirrors mirrors hang on the walls, and mirror/0.png, ... are 255 where the photos show one;
depth and the mesh are those of the glass.
With --pose-noise the poses are wrong, and `pose_true` holds the right ones.
With --phone the photos are a phone's (`phone_camera.effects`), each room's another one: its noise and JPEG take the
place of those options, phone.json says what it did, depth and the mesh stay exact.
The same options give the same bytes; captures that are there already are kept. Seed 0 is refused: it made the rooms
that the shipped network is trained on.
"""

from __future__ import annotations

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from room2dgs.demo_room.atlas import linear_to_srgb
from room2dgs.demo_room.capture_files import (
    OPTIONS,
    check_limits,
    exposure_gains,
    make_folders,
    write_frame,
    write_intrinsics,
    write_poses,
    write_truth,
)
from room2dgs.demo_room.geometry import FACET, Patch, triangulated
from room2dgs.demo_room.light import cast
from room2dgs.demo_room.mesh import visible_mesh
from room2dgs.demo_room.render import exposed, pinhole, ray_scene
from room2dgs.errors import InputError
from room2dgs.files import whole_file, whole_folder
from room2dgs.mesh.open3d import o3c_tensor
from room2dgs.tools.command_line import command_line
from room2dgs.tools.phone_camera.effects import EFFECTS, chosen, spelled
from room2dgs.tools.phone_camera.filming import filming
from room2dgs.tools.random_rooms.blank import with_blank_walls
from room2dgs.tools.random_rooms.layout import RandomRoom, random_room
from room2dgs.tools.random_rooms.mirrors import GLASS, with_mirrors
from room2dgs.tools.random_rooms.render import Room, light_up, rays, render
from room2dgs.tools.random_rooms.truth import plan_truth
from room2dgs.tools.random_rooms.walk import Walk, floor_area, random_walk
from room2dgs.tools.shake_poses import shaken

FINE = 2  # colour rays along each side of a pixel
BLUR = 0.5  # pixels, the lens
AREA = (6.0, 45.0)  # square metres of rooms that are filmed
PIECES = 60  # surfaces of the least furnished room that is filmed
BRIGHTNESS = 0.42  # sRGB, of the photos' median
METERED = 8  # times smaller are the pictures that the exposure is set by
TRIES = 200  # rooms until one can be filmed


@dataclass(frozen=True)
class CaptureOptions:
    """What to make.

    Attributes:
        seed: fixes everything.
        photos: of the walk; 0 lets the room's size say.
        width, height: of the photos, pixels.
        blank: share of the walls that are painted in one colour, whatever the room had.
        sensor_noise: deviation of the image noise, 8-bit levels.
        exposure_drift: largest change of exposure along the walk, stops.
        pose_noise_deg, pose_noise_cm: error of the written poses, root of the mean square over the photos.
        jpeg_quality: 1 to 100.
        phone: effects of a phone, as `phone_camera.effects.chosen` reads them.
        mirrors: that hang on the walls, where these are free.
    """

    seed: int = 9000
    photos: int = 0
    width: int = 640
    height: int = 480
    blank: float = 0.7
    sensor_noise: float = 2.0
    exposure_drift: float = 0.1
    pose_noise_deg: float = 0.0
    pose_noise_cm: float = 0.0
    jpeg_quality: int = 92
    phone: str = "none"
    mirrors: int = 0


PHONE = "phone.json"
PLAN_TRUTH = "plan_true.json"
MIRROR = "mirror"
LIMITS = {
    "seed": (1, 2**63 - 1),
    "photos": (0, 10_000),
    "width": (16, 8192),
    "height": (16, 8192),
    "blank": (0, 1),
    "sensor_noise": (0, 100),
    "exposure_drift": (0, 4),
    "pose_noise_deg": (0, 45),
    "pose_noise_cm": (0, 100),
    "jpeg_quality": (1, 100),
    "mirrors": (0, 8),
}


def make_capture(out: Path | str, number: int, options: CaptureOptions) -> Path:
    """Films one room; it appears at `out` only when it is complete, and is kept if it is there already.

    Args:
        out: folder to write.
        number: of the room among those of the seed.
        options: what to make.

    Raises:
        InputError: an option is out of range, `out` holds something else, or the disk refuses.
    """
    out = Path(out)
    check_limits(options, LIMITS)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        if _made_with(out) != {**asdict(options), "room": number}:
            raise InputError(f"{out} is no capture that was made with these options; choose another folder")
        if not (out / PLAN_TRUTH).exists():  # of a capture that was made before there was one
            write_plan_truth(out, found_room(number, options)[0])
        return out
    with whole_folder(out) as unfinished:
        write_capture(unfinished, number, options)
    return out


def write_capture(out: Path, number: int, options: CaptureOptions) -> None:
    """Writes all files of the capture into the empty folder `out`."""
    planned, patches, walk, draw = found_room(number, options)
    room = light_up(patches, stream(options, number, draw, 3))
    K = pinhole(options.width, options.height, walk.fov)
    gain = exposure(room, K, walk.poses, options)
    gains = gain * exposure_gains(len(walk.poses), options.exposure_drift, stream(options, number, draw, 4))
    make_folders(out)
    filmed = filming(chosen(options.phone), walk.poses, stream(options, number, draw, 8))
    quality = filmed.phone.jpeg_quality if "jpeg" in filmed.effects else options.jpeg_quality
    for index, world_from_cam in enumerate(walk.poses):
        mirrored, noise = stream(options, number, draw, 5, index), stream(options, number, draw, 6, index)
        view = render(room, K[0, 0], world_from_cam, options.width, options.height, mirrored, FINE)
        if filmed.effects:
            size = options.width, options.height
            light = gains[index] * filmed.radiance(room, index, K[0, 0], world_from_cam, size, mirrored)
            photo = filmed.photo(cv2.GaussianBlur(light, (0, 0), BLUR), index, [options.seed, number, draw, 9, index])
        else:
            blurred = cv2.GaussianBlur(view.radiance, (0, 0), BLUR)
            photo = exposed(blurred, gains[index], options.sensor_noise, noise)
        write_frame(out, index, photo, view.depth, quality)
    if filmed.effects:
        (out / PHONE).write_text(json.dumps(filmed.as_dict(), indent=1) + "\n", encoding="utf-8")
        if "drift" in filmed.effects:
            write_poses(out / "pose_true", walk.poses)
    degrees, cm, wrong = options.pose_noise_deg, options.pose_noise_cm, filmed.written
    if degrees or cm:
        random = stream(options, number, draw, 7)
        wrong = np.stack([shaken(world_from_cam, degrees, cm, random) for world_from_cam in wrong])
        write_poses(out / "pose_true", walk.poses)
    write_poses(out / "pose", wrong)
    write_intrinsics(out, K)
    if options.mirrors:
        write_mirror_masks(out / MIRROR, room, patches, K, walk.poses, options)
    mesh = visible_mesh(room, patches, K, walk.poses, options.width, options.height)
    write_truth(out, mesh, made(options, number, draw, walk))
    write_plan_truth(out, planned)


def write_mirror_masks(
    out: Path, room: Room, patches: list[Patch], K: np.ndarray, poses: np.ndarray, options: CaptureOptions
) -> None:
    """Writes out/0.png, ...: 255 where the photo shows a mirror."""
    out.mkdir()
    mirrors = np.array([patch.tag == GLASS for patch in patches])
    for index, world_from_cam in enumerate(poses):
        hits = cast(room.scene, *rays(K[0, 0], world_from_cam, options.width, options.height, 1))
        seen = np.isfinite(hits["t_hit"])
        seen[seen] = mirrors[room.soup.patch[hits["primitive_ids"][seen]]]
        mask = np.where(seen, 255, 0).astype(np.uint8).reshape(options.height, options.width)
        if not cv2.imwrite(str(out / f"{index}.png"), mask):
            raise OSError(f"{out / f'{index}.png'} cannot be written")


def write_plan_truth(out: Path, room: RandomRoom) -> None:
    """Writes what a plan of the room should say."""
    with whole_file(out / PLAN_TRUTH) as temporary:
        temporary.write_text(json.dumps(plan_truth(room), indent=1) + "\n", encoding="utf-8")


def made(options: CaptureOptions, number: int, draw: int, walk: Walk) -> dict[str, Any]:
    """What room.json says: the options as they were given, and what came of them."""
    return {**asdict(options), "room": number, "draw": draw, "filmed": len(walk.poses), "fov": walk.fov}


def found_room(number: int, options: CaptureOptions) -> tuple[RandomRoom, list[Patch], Walk, int]:
    """The first room of this number that can be filmed, its surfaces, the walk, and which draw it was."""
    for draw in range(TRIES):
        room = random_room(stream(options, number, draw, 0))
        if room.storm or not AREA[0] <= floor_area(room) <= AREA[1] or len(room.patches) < PIECES:
            continue
        patches = [
            evenly_cut(patch)
            for patch in with_blank_walls(room.patches, options.blank, stream(options, number, draw, 1))
        ]
        if options.mirrors:
            patches = with_mirrors(room, patches, options.mirrors, stream(options, number, draw, 10))
        walk = walked(room, patches, stream(options, number, draw, 2), options.photos or None)
        if walk is not None:
            return room, patches, walk, draw
    raise RuntimeError(f"none of {TRIES} rooms could be walked; a mistake of the rooms or the walk")


def walked(room: RandomRoom, patches: list[Patch], rng: np.random.Generator, photos: int | None) -> Walk | None:
    """A walk through the room with these surfaces."""
    scene = ray_scene(triangulated(patches))

    def distance(points: np.ndarray) -> np.ndarray:
        return scene.compute_distance(o3c_tensor(np.ascontiguousarray(points, np.float32))).numpy()

    def reach(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        return cast(scene, origins, directions)["t_hit"]

    return random_walk(room, distance, reach, rng, photos)


def evenly_cut(patch: Patch) -> Patch:
    """A patch with bent cells is cut finely, so that the triangles that are filmed are those of the truth."""
    a, b, c, d = patch.grid[:-1, :-1], patch.grid[:-1, 1:], patch.grid[1:, 1:], patch.grid[1:, :-1]
    volume = np.einsum("...i,...i->...", np.cross(b - a, c - a), d - a)
    across = np.maximum(np.linalg.norm(c - a, axis=-1), np.linalg.norm(d - b, axis=-1))
    return patch.refined(FACET) if np.abs(volume / np.maximum(across**2, 1e-12)).max() > 1e-5 else patch


def exposure(room: Room, K: np.ndarray, poses: np.ndarray, options: CaptureOptions) -> float:
    """The gain that brings the median of the walk's photos to `BRIGHTNESS`; from small ones."""
    width, height = options.width // METERED, options.height // METERED
    rng = np.random.default_rng(options.seed)
    small = [render(room, K[0, 0] / METERED, pose, width, height, rng, 1).radiance for pose in poses[::4]]
    median = float(np.median(np.stack(small).mean(axis=-1)))
    gains = 2.0 ** np.linspace(-4, 4, 161)
    return float(gains[np.abs(linear_to_srgb(gains * median) - BRIGHTNESS).argmin()])


def stream(options: CaptureOptions, number: int, *which: int) -> np.random.Generator:
    """A source of random numbers of its own for each purpose."""
    return np.random.default_rng([options.seed, number, *which])


@command_line("make_captures")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="make_captures",
        description="Film random rooms as hand-held walks with exact ground truth (ScanNet layout).",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    plain = CaptureOptions()
    parser.add_argument("out", type=Path, help="folder of captures")
    parser.add_argument("--rooms", type=int, default=8, help="captures in all")
    parser.add_argument("--seed", type=int, default=plain.seed, help="fixes everything; not 0")
    parser.add_argument("--photos", type=int, default=plain.photos, help="of a walk; 0: by the room's size, 60 to 120")
    parser.add_argument("--width", type=int, default=plain.width, help="photo width in pixels")
    parser.add_argument("--height", type=int, default=plain.height, help="photo height in pixels")
    parser.add_argument("--blank", type=float, default=plain.blank, help="share of the walls painted in one colour")
    parser.add_argument("--sensor-noise", type=float, default=plain.sensor_noise, help="8-bit levels")
    parser.add_argument("--exposure-drift", type=float, default=plain.exposure_drift, help="stops")
    parser.add_argument("--pose-noise", default="0,0", metavar="DEG,CM", help="error of the written poses")
    parser.add_argument("--jpeg-quality", type=int, default=plain.jpeg_quality, help="1 to 100")
    parser.add_argument(
        "--phone",
        nargs="?",
        const="all",
        default=plain.phone,
        metavar="EFFECTS",
        help=f"photos as a phone's: all, or some of {', '.join(EFFECTS)}, with commas between",
    )
    parser.add_argument("--mirrors", type=int, default=plain.mirrors, help="that hang on the walls of a room")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    given = vars(parser.parse_args(arguments))
    out, rooms, workers, pose_noise = (given.pop(name) for name in ("out", "rooms", "workers", "pose_noise"))
    degrees, centimetres = both_numbers(pose_noise)
    given["phone"] = spelled(chosen(given["phone"]))
    options = replace(CaptureOptions(**given), pose_noise_deg=degrees, pose_noise_cm=centimetres)
    check_limits(options, LIMITS)
    if rooms < 1 or workers < 1:
        raise InputError("--rooms and --workers are at least 1")
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is not a folder; choose another name")
    make = partial(_numbered, out, options)
    if workers == 1:
        for number in range(rooms):
            print(make(number), flush=True)
    else:
        with ProcessPoolExecutor(workers) as processes:
            for path in processes.map(make, range(rooms)):
                print(path, flush=True)


def both_numbers(text: str) -> tuple[float, float]:
    """Degrees and centimetres of "DEG,CM".

    Raises:
        InputError: it is something else.
    """
    try:
        degrees, centimetres = map(float, text.split(","))
    except ValueError as error:
        raise InputError(f"--pose-noise {text} is not DEG,CM; give for example 0.5,1") from error
    return degrees, centimetres


def _made_with(out: Path) -> dict[str, Any]:
    """Options and number of the capture in a folder; nothing if it holds none."""
    try:
        made = json.loads((out / OPTIONS).read_text(encoding="utf-8"))
        later = {"phone": made.get("phone", "none"), "mirrors": made.get("mirrors", 0)}
        return {**{name: made[name] for name in (*LIMITS, "room") if name not in later}, **later}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _numbered(out: Path, options: CaptureOptions, number: int) -> Path:
    return make_capture(out / f"room_{number:02d}", number, options)


if __name__ == "__main__":
    sys.exit(main())
