"""`room2dgs demo DIR`: a made room to try everything on."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from room2dgs.commands.flags import add_flags

HELP = """Makes photos of a furnished room, with exact depth and a ground-truth mesh: a capture in ScanNet's layout, to
try everything on. The same options give the same bytes."""
OPTIONS = {
    "seed": "fixes arrangement, textures, walk and noise",
    "frames": "number of photos",
    "frames_a_lap": "photos once around the room; some hundred make a video",
    "width": "photo width in pixels",
    "height": "photo height in pixels",
    "fov": "horizontal field of view in degrees",
    "noise": "deviation of the image noise in 8-bit levels",
    "exposure_drift": "largest change of exposure in stops",
    "blank_walls": "walls of uniform paint, 0 to 4",
    "gloss": "mirror reflection of the floor, 0 to 1",
    "jpeg_quality": "1 to 100",
}


def main(argv: list[str]) -> int:
    """Make the room.

    Raises:
        InputError: an option is out of range, or the folder holds something that must not be replaced.
    """
    from room2dgs.demo_room.make import RoomOptions, make_room

    parser = argparse.ArgumentParser(
        prog="room2dgs demo", description=HELP, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("out", type=Path, help="folder to write")
    add_flags(parser, RoomOptions, OPTIONS)
    parser.add_argument("--overwrite", action="store_true", help="replace an earlier room in that folder")
    given = vars(parser.parse_args(argv))
    out, overwrite = given.pop("out"), given.pop("overwrite")
    make_room(out, RoomOptions(**given), overwrite)
    print(f"{out}: {given['frames']} photos of {given['width']}x{given['height']}, seed {given['seed']}")
    print(f"next: room2dgs run {shlex.quote(str(out))} out={shlex.quote(f'runs/{out.name}')}")
    return 0
