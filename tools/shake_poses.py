"""Makes a capture whose poses are a little off, to see what comes of that.

    python -m room2dgs.tools.shake_poses CAPTURE OUT --degrees 0.5 --cm 1
    python -m room2dgs.tools.shake_poses CAPTURE OUT --drift

Every camera is turned about a random axis and shifted, each independently of the others. With `--drift` the errors are
those of a tracker instead (`pose_drift`): they grow smoothly along the way and jump at relocalisations. Photos, depth,
intrinsics and the ground truth are links to those of the capture (ScanNet layout).
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from room2dgs.captures.matrix_files import NonFinitePose, read_world_from_cam
from room2dgs.errors import InputError
from room2dgs.files import whole_folder
from room2dgs.tools.command_line import command_line
from room2dgs.tools.pose_drift import Drift, drifted


def shake_poses(capture: Path, out: Path, degrees: float, cm: float, seed: int = 0, drift: Drift | None = None) -> None:
    """Writes the folder `out`, whole or not at all.

    Args:
        degrees, cm: root mean square of the angles and of the ways of the centres.
        drift: errors of a tracker instead of those; photos count as walked in the order of their numbers.

    Raises:
        InputError: no capture, a taken folder, a pose that cannot be read, or errors that are no sizes.
    """
    if not all(math.isfinite(value) and value >= 0 for value in (degrees, cm)):
        raise InputError(f"--degrees {degrees} --cm {cm} is impossible; give numbers of 0 or more")
    if drift is not None:
        _check_drift(drift)
    paths = sorted((capture / "pose").glob("*.txt"), key=lambda path: (len(path.name), path.name))
    if not paths:
        raise InputError(f"{capture} has no pose/*.txt; name the folder of a capture in the ScanNet layout")
    if out.exists():
        raise InputError(f"{out} is there already; choose another folder")
    random = np.random.default_rng(seed)
    with whole_folder(out) as folder:
        (folder / "pose").mkdir()
        for other in sorted(capture.iterdir()):
            if other.name != "pose":
                (folder / other.name).symlink_to(other.resolve(), target_is_directory=other.is_dir())
        poses: dict[str, np.ndarray] = {}
        for path in paths:
            try:
                poses[path.name] = read_world_from_cam(path)
            except NonFinitePose:
                (folder / "pose" / path.name).write_text(path.read_text())
        if drift is None:
            wrong = [shaken(world_from_cam, degrees, cm, random) for world_from_cam in poses.values()]
        else:
            wrong = list(drifted(np.stack(list(poses.values())), drift, random)[0]) if poses else []
        for name, world_from_cam in zip(poses, wrong, strict=True):
            np.savetxt(folder / "pose" / name, world_from_cam, fmt="%.12f")


def _check_drift(drift: Drift) -> None:
    rates = drift.cm_per_m, drift.degrees_per_m
    if not all(math.isfinite(value) and value >= 0 for value in rates) or not drift.relocalise_m > 0:
        raise InputError(
            f"--cm-per-m {drift.cm_per_m} --degrees-per-m {drift.degrees_per_m} --relocalise-m {drift.relocalise_m} is "
            "impossible; give rates of 0 or more, and metres above 0 between relocalisations"
        )


def shaken(world_from_cam: np.ndarray, degrees: float, cm: float, random: np.random.Generator) -> np.ndarray:
    """(4, 4) pose turned about a random axis and shifted; the root mean squares over many are `degrees` and `cm`."""
    turn, shift = random.normal(size=(2, 3)) / math.sqrt(3)
    wrong = world_from_cam.copy()
    wrong[:3, :3] = Rotation.from_rotvec(math.radians(degrees) * turn).as_matrix() @ wrong[:3, :3]
    wrong[:3, 3] += 0.01 * cm * shift
    return wrong


@command_line("shake_poses")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="shake_poses",
        description="Make a capture whose poses are a little off.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("capture", type=Path, help="folder in the ScanNet layout")
    parser.add_argument("out", type=Path, help="new folder")
    parser.add_argument("--degrees", type=float, default=0.5, help="root mean square of the rotations")
    parser.add_argument("--cm", type=float, default=1.0, help="root mean square of the shifts")
    parser.add_argument("--seed", type=int, default=0, help="fixes everything")
    parser.add_argument("--drift", action="store_true", help="errors of a tracker instead of independent ones")
    parser.add_argument("--cm-per-m", type=float, default=Drift.cm_per_m, help="drift for each metre walked")
    parser.add_argument("--degrees-per-m", type=float, default=Drift.degrees_per_m, help="rotation's drift")
    parser.add_argument(
        "--relocalise-m", type=float, default=Drift.relocalise_m, help="metres between relocalisations, on average"
    )
    options = parser.parse_args(arguments)
    drift = Drift(options.cm_per_m, options.degrees_per_m, options.relocalise_m) if options.drift else None
    shake_poses(options.capture, options.out, options.degrees, options.cm, options.seed, drift)


if __name__ == "__main__":
    sys.exit(main())
