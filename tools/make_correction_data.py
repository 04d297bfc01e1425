"""Makes what the correction of depth learns from: completed depth of filmed random rooms, and how far off it is.

    python -m room2dgs.tools.make_correction_data OUT --rooms 60 --seed 1

Each room is filmed (`make_captures`) with its own noise, exposures and, for some, poses that are off. Poses are refined
and the depth of the photos is found as a run does it; then the film is deleted. A room is a folder of .npy files, with
N the photos in both passes:
    evidence.npy (N, CHANNELS, h, w) float16, see `room2dgs.depth.completion.evidence`;
    shift.npy    (N, h, w) float16, ln of true over completed depth, NaN = unknown.
Rooms that are there already are kept.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock

import numpy as np

from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import load_config
from room2dgs.depth import estimate_depth
from room2dgs.depth.completion.correction import Correct
from room2dgs.depth.completion.evidence import ERROR, KNOWN, LN_DEPTH, LN_MEDIAN
from room2dgs.errors import InputError
from room2dgs.files import whole_folder
from room2dgs.sfm.refinement import refined_poses
from room2dgs.sfm.sparse import sparse_points
from room2dgs.splat import set_threads
from room2dgs.tools.command_line import command_line
from room2dgs.tools.correction_network.samples import EVIDENCE, SHIFT
from room2dgs.tools.make_captures import CaptureOptions, make_capture

PHOTOS = (40, 60)
BLANK = (0.5, 0.95)
SENSOR_NOISE = (1.0, 4.0)
EXPOSURE_DRIFT = (0.0, 0.3)
JPEG_QUALITY = (85, 96)
SHAKEN = 0.4  # of the rooms
POSE_NOISE_DEG, POSE_NOISE_CM = (0.1, 0.5), (0.3, 1.0)  # before poses are refined, which leaves what a run leaves
WHOLE = 0.3  # of the rooms, at the photos' own size; the others at `DRAFT`
DRAFT = 320
SETTINGS = ("prior=room_prior", "prior.depth.correction=false", "out=unused")


def make_room(out: Path, seed: int, number: int) -> Path:
    """Writes the folder `room_<number>` of `out`, whole or not at all; keeps one that is there."""
    folder = out / f"room_{number:04d}"
    if folder.is_dir():
        return folder
    random = np.random.default_rng([seed, number])
    options = capture_options(seed, random)
    width = None if random.random() < WHOLE else DRAFT
    with TemporaryDirectory() as scratch:
        capture = make_capture(Path(scratch) / "capture", number, options)
        evidence, shift = views(capture, width, Path(scratch))
    with whole_folder(folder) as unfinished:
        np.save(unfinished / EVIDENCE, evidence)
        np.save(unfinished / SHIFT, shift)
    return folder


def capture_options(seed: int, random: np.random.Generator) -> CaptureOptions:
    """How a room is filmed."""
    shaken = random.random() < SHAKEN
    return CaptureOptions(
        seed=seed,
        photos=int(random.integers(*PHOTOS)),
        blank=random.uniform(*BLANK),
        sensor_noise=random.uniform(*SENSOR_NOISE),
        exposure_drift=random.uniform(*EXPOSURE_DRIFT),
        pose_noise_deg=random.uniform(*POSE_NOISE_DEG) if shaken else 0.0,
        pose_noise_cm=random.uniform(*POSE_NOISE_CM) if shaken else 0.0,
        jpeg_quality=int(random.integers(*JPEG_QUALITY)),
    )


def views(capture: Path, width: int | None, out: Path) -> tuple[np.ndarray, np.ndarray]:
    """Evidence and true correction of a capture's training views of both passes, as `make_room` writes them."""
    given = [f"scene.path={capture}", *SETTINGS, *([f"scene.image_width={width}"] if width else [])]
    config = load_config(given)
    scene, _ = refined_poses(read_scene(config.scene), config.sfm, config.points, out / "points", _quiet)
    points = sparse_points(scene, config.points, out / "points", _quiet)
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    estimate_depth(scene, points, config, out / "maps", _quiet, correct=recording(scene, seen))
    return np.stack([one for one, _ in seen]), np.stack([one for _, one in seen])


def recording(scene: Scene, seen: list[tuple[np.ndarray, np.ndarray]]) -> Correct:
    """What corrects nothing and keeps evidence and truth."""
    frames, lock = {frame.name: frame for frame in scene.keyframes}, Lock()

    def correct(name: str, evidence: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        shift = true_shift(frames[name], evidence)
        with lock:
            seen.append((evidence.astype(np.float16), shift.astype(np.float16)))
        return np.zeros_like(shift), evidence[ERROR]

    return correct


def true_shift(frame: Frame, evidence: np.ndarray) -> np.ndarray:
    """(h, w) float32 ln of true over completed depth at the pixels' centres; NaN = unknown."""
    height, width = evidence.shape[1:]
    assert frame.depth_path is not None
    truth = depth_file(frame.depth_path, frame.depth_unit_m).seen_by(frame.camera.resized(width, height), None)
    known = (truth > 0) & (evidence[KNOWN] > 0)
    return np.where(known, np.log(np.where(known, truth, 1)) - evidence[LN_DEPTH] - evidence[LN_MEDIAN], np.nan)


def _quiet(_line: str) -> None:
    pass


def _made(out: Path, seed: int, number: int) -> Path:
    set_threads(1)
    return make_room(out, seed, number)


@command_line("make_correction_data")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="make_correction_data",
        description="Make completed depth of random rooms, and how far off it is.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("out", type=Path, help="folder of rooms")
    parser.add_argument("--rooms", type=int, default=60, help="rooms in all")
    parser.add_argument("--seed", type=int, default=1, help="fixes everything")
    parser.add_argument("--first", type=int, default=0, help="number of the first room")
    parser.add_argument("--workers", type=int, default=1, help="processes, each on one core")
    options = parser.parse_args(arguments)
    if options.out.exists() and not options.out.is_dir():
        raise InputError(f"{options.out} is not a folder; choose another name")
    if options.rooms < 1 or options.workers < 1:
        raise InputError("--rooms and --workers are at least 1")
    with ProcessPoolExecutor(options.workers) as processes:
        numbers = range(options.first, options.first + options.rooms)
        for path in processes.map(partial(_made, options.out, options.seed), numbers):
            print(path, flush=True)


if __name__ == "__main__":
    sys.exit(main())
