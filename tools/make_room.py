"""Makes a furnished room with exact ground truth in the ScanNet layout.

    python -m room2dgs.tools.make_room OUT --seed 0

Written: color/<i>.jpg, depth/<i>.png (16-bit millimetres, z-depth at the pixel's centre, 0 = a light),
pose/<i>.txt (camera-to-world, metres, OpenCV axes), intrinsic/intrinsic_{color,depth}.txt (4x4, pixel centres
at integers as in ScanNet), gt_mesh.ply (only what the cameras saw) and room.json (the options).
The same options give the same bytes.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import cv2
import numpy as np

from room2dgs.errors import InputError
from room2dgs.files import whole_folder
from room2dgs.tools.demo_room.layout import room_patches
from room2dgs.tools.demo_room.mesh import visible_mesh
from room2dgs.tools.demo_room.path import camera_path
from room2dgs.tools.demo_room.render import build_room, exposed, pinhole, render

CONTENT = {"color", "depth", "pose", "intrinsic", "gt_mesh.ply", "room.json"}


@dataclass(frozen=True)
class RoomOptions:
    """What to make.

    Attributes:
        seed: fixes the arrangement, the textures, the walk and the noise.
        frames: photos along the walk.
        width, height: of the photos, pixels.
        fov: horizontal field of view, degrees.
        noise: deviation of the image noise, 8-bit levels.
        exposure_drift: largest change of exposure along the walk, stops.
        blank_walls: walls of uniform paint, 0 to 4.
        gloss: mirror reflection of the floor, 0 (matt, no view dependence) to 1 (polished).
        jpeg_quality: 1 to 100.
    """

    seed: int = 0
    frames: int = 60
    width: int = 320
    height: int = 240
    fov: float = 70.0
    noise: float = 1.0
    exposure_drift: float = 0.0
    blank_walls: int = 0
    gloss: float = 0.0
    jpeg_quality: int = 95


LIMITS = {
    "seed": (0, 2**63 - 1),
    "frames": (1, 100_000),
    "width": (16, 8192),
    "height": (16, 8192),
    "fov": (10, 150),
    "noise": (0, 100),
    "exposure_drift": (0, 4),
    "blank_walls": (0, 4),
    "gloss": (0, 1),
    "jpeg_quality": (1, 100),
}


def make_room(out: Path | str, options: RoomOptions | None = None, overwrite: bool = False) -> Path:
    """Writes a capture of a furnished room; it appears at `out` only when it is complete.

    Args:
        out: folder to write.
        options: what to make; the defaults are the demo.
        overwrite: replace an earlier room at `out`.

    Returns:
        `out`.

    Raises:
        InputError: an option is out of range, or `out` holds something that must not be replaced.
    """
    options = options or RoomOptions()
    check_options(options)
    out = Path(out)
    check_free(out, overwrite)
    with whole_folder(out) as partial:
        write_capture(partial, options)
    return out


def check_options(options: RoomOptions) -> None:
    """Raises InputError for an option out of its range."""
    for name, (low, high) in LIMITS.items():
        value = getattr(options, name)
        if not low <= value <= high:
            raise InputError(f"{name} is {value}; give a value from {low} to {high}")


def check_free(out: Path, overwrite: bool) -> None:
    """Raises InputError if writing to `out` would replace something."""
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InputError(f"{out} is not a folder; choose another name")
    names = {path.name for path in out.iterdir()} if out.exists() else set()
    if names and not overwrite:
        raise InputError(f"{out} is not empty; choose another folder or add --overwrite")
    if names - CONTENT:
        raise InputError(
            f"{out} holds {sorted(names - CONTENT)[0]}, which is not part of a room; choose another folder"
        )


def write_capture(out: Path, options: RoomOptions) -> None:
    """Writes all files of the capture into the empty folder `out`."""
    room = build_room(room_patches(options.seed, options.blank_walls), options.seed)
    poses = camera_path(options.frames, room.distance, np.random.default_rng([options.seed, 4]))
    K = pinhole(options.width, options.height, options.fov)
    gains = exposure_gains(options)
    for folder in ("color", "depth", "pose", "intrinsic"):
        (out / folder).mkdir()
    for index, world_from_cam in enumerate(poses):
        color, depth = render(room, K, world_from_cam, options.width, options.height, options.gloss)
        photo = exposed(color, gains[index], options.noise, np.random.default_rng([options.seed, 5, index]))
        millimetres = np.round(1000 * depth).astype(np.uint16)
        write_image(out / f"color/{index}.jpg", photo[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, options.jpeg_quality])
        write_image(out / f"depth/{index}.png", millimetres, [])
        np.savetxt(out / f"pose/{index}.txt", world_from_cam, fmt="%.9f")
    on_disk = np.eye(4)
    on_disk[:3, :3] = K
    on_disk[:2, 2] -= 0.5  # ScanNet counts pixel centres at integers
    for name in ("color", "depth"):
        np.savetxt(out / f"intrinsic/intrinsic_{name}.txt", on_disk, fmt="%.9f")
    mesh = visible_mesh(room, K, poses, options.width, options.height)
    (out / "gt_mesh.ply").write_bytes(mesh.export(file_type="ply"))
    (out / "room.json").write_text(json.dumps(asdict(options), indent=1) + "\n")


def exposure_gains(options: RoomOptions) -> np.ndarray:
    """(frames,) factors of the exposure: a slow wander, its extreme exposure_drift stops from 1."""
    rng = np.random.default_rng([options.seed, 6])
    time = np.linspace(0, 2 * np.pi, options.frames)
    phase = rng.uniform(0, 2 * np.pi, 3)
    wander = np.sin(time + phase[0]) + 0.5 * np.sin(2.3 * time + phase[1]) + 0.25 * np.sin(5.1 * time + phase[2])
    return 2.0 ** (options.exposure_drift * wander / np.abs(wander).max())


def write_image(path: Path, image: np.ndarray, parameters: list[int]) -> None:
    """Encodes by the name's ending; a full disk raises OSError, where cv2.imwrite only returns False."""
    encoded = cv2.imencode(path.suffix, image, parameters)[1]
    path.write_bytes(encoded.tobytes())


def main(arguments: list[str] | None = None) -> int:
    """The command line; returns the exit code (0 done, 2 bad input)."""
    parser = argparse.ArgumentParser(
        prog="make_room",
        description="Make a furnished room with exact ground truth (ScanNet layout).",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    helps = {
        "seed": "fixes arrangement, textures, walk and noise",
        "frames": "number of photos",
        "width": "photo width in pixels",
        "height": "photo height in pixels",
        "fov": "horizontal field of view in degrees",
        "noise": "deviation of the image noise in 8-bit levels",
        "exposure_drift": "largest change of exposure in stops",
        "blank_walls": "walls of uniform paint, 0 to 4",
        "gloss": "mirror reflection of the floor, 0 to 1",
        "jpeg_quality": "1 to 100",
    }
    parser.add_argument("out", type=Path, help="folder to write")
    for option in fields(RoomOptions):
        flag = "--" + option.name.replace("_", "-")
        parser.add_argument(flag, type=type(option.default), default=option.default, help=helps[option.name])
    parser.add_argument("--overwrite", action="store_true", help="replace an earlier room in that folder")
    given = vars(parser.parse_args(arguments))
    out, overwrite = given.pop("out"), given.pop("overwrite")
    try:
        make_room(out, RoomOptions(**given), overwrite)
    except InputError as error:
        print(f"make_room: {error}", file=sys.stderr)
        return 2
    print(f"{out}: {given['frames']} photos of {given['width']}x{given['height']}, seed {given['seed']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
