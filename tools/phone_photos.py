"""Makes a capture whose photos look as if a phone had taken them, to see what comes of that.

    python -m room2dgs.tools.phone_photos CAPTURE OUT --phone wander
    python -m room2dgs.tools.phone_photos CAPTURE OUT --phone all --seed 3

Effects are those of single photos (`phone_camera.effects`) and the wander of exposure and white balance; the others
need a room to film again: `make_captures --phone`. Depth, poses, intrinsics and the ground truth are links to those
of the capture (ScanNet layout); phone.json says what was done, with each photo's true gains.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.image_files import read_photo
from room2dgs.demo_room.atlas import srgb_to_linear
from room2dgs.demo_room.capture_files import write_image
from room2dgs.errors import InputError
from room2dgs.files import whole_folder
from room2dgs.tools.command_line import command_line
from room2dgs.tools.phone_camera.effects import OF_PHOTO, chosen, spelled
from room2dgs.tools.phone_camera.phone import Phone, random_phone
from room2dgs.tools.phone_camera.photo import phone_photo
from room2dgs.tools.phone_camera.wander import of_light, wandering_gains

MADE = "phone.json"
POSSIBLE = frozenset(OF_PHOTO) | {"wander"}
FINEST = [cv2.IMWRITE_JPEG_QUALITY, 98, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]


def phone_photos(
    capture: Path, out: Path, effects: frozenset[str], seed: int = 0, wander: float = Phone.wander
) -> None:
    """Writes the folder `out`, whole or not at all.

    Args:
        effects: of `POSSIBLE`.
        seed: decides the phone, its noise and its wander.
        wander: share by which levels of nine photos in ten are within, both ways.

    Raises:
        InputError: no capture, a taken folder, an effect that needs the room, or a wander that is no share.
    """
    if effects - POSSIBLE:
        raise InputError(f"{spelled(effects - POSSIBLE)} needs the room, not its photos; use make_captures --phone")
    if not 0 <= wander <= 4:
        raise InputError(f"--wander {wander} is impossible; give a share from 0 to 4")
    paths = sorted((capture / "color").glob("*"), key=lambda path: (len(path.name), path.name))
    if not paths:
        raise InputError(f"{capture} has no color/*; name the folder of a capture in the ScanNet layout")
    if out.exists():
        raise InputError(f"{out} is there already; choose another folder")
    phone = replace(random_phone(np.random.default_rng([seed, 0])), wander=wander)
    gains = wandering_gains(len(paths), wander, np.random.default_rng([seed, 1]))
    if "wander" not in effects:
        gains = np.ones_like(gains)
    with whole_folder(out) as folder:
        (folder / "color").mkdir()
        for other in sorted(capture.iterdir()):
            if other.name not in ("color", MADE):
                (folder / other.name).symlink_to(other.resolve(), target_is_directory=other.is_dir())
        for index, (path, gain) in enumerate(zip(paths, gains, strict=True)):
            light = srgb_to_linear(read_photo(path, None)) * of_light(gain).astype(np.float32)
            photo = phone_photo(light, [seed, 2, index], phone, effects)
            quality = [cv2.IMWRITE_JPEG_QUALITY, phone.jpeg_quality] if "jpeg" in effects else FINEST
            write_image(folder / "color" / f"{path.stem}.jpg", photo[..., ::-1], quality)
        said = {"effects": spelled(effects), "seed": seed, "phone": asdict(phone)}
        levels = {path.stem: [round(value, 6) for value in gain] for path, gain in zip(paths, gains, strict=True)}
        (folder / MADE).write_text(json.dumps({**said, "gains": levels}, indent=1) + "\n", encoding="utf-8")


@command_line("phone_photos")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="phone_photos",
        description="Make a capture whose photos look as if a phone had taken them.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("capture", type=Path, help="folder in the ScanNet layout")
    parser.add_argument("out", type=Path, help="new folder")
    parser.add_argument("--phone", default=spelled(POSSIBLE), metavar="EFFECTS", help="effects, with commas between")
    parser.add_argument("--seed", type=int, default=0, help="fixes everything")
    parser.add_argument("--wander", type=float, default=Phone.wander, help="of the levels, nine photos of ten")
    given = parser.parse_args(arguments)
    effects = chosen(given.phone)
    # "all" means all that can be done here
    effects = effects & POSSIBLE if given.phone.startswith("all") else effects
    phone_photos(given.capture, given.out, effects, given.seed, given.wander)


if __name__ == "__main__":
    sys.exit(main())
