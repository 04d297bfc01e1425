"""Says how far the poses of runs are from true ones.

    python -m room2dgs.tools.pose_errors CAPTURE RUN ...

CAPTURE has the true poses (ScanNet layout), RUN is the folder of a run on a copy of it whose poses are off, as
`shake_poses` makes them. Root mean square and largest error over the views that take part, as given and as refined.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from room2dgs.captures.matrix_files import read_world_from_cam
from room2dgs.captures.poses_file import LEFT_OUT
from room2dgs.errors import InputError
from room2dgs.geometry.poses import inverse_pose
from room2dgs.tools.command_line import command_line

KINDS = "given", "refined"


def pose_errors(capture: Path, run: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """ "given", "refined" -> (V,) metres between the centres and (V,) degrees, true against the run's.

    Raises:
        InputError: the run has no poses.json, or a view that the capture does not have.
    """
    path = run / "poses.json"
    if not path.is_file():
        raise InputError(f"{path} is missing; name the folder of a run")
    content = json.loads(path.read_text(encoding="utf-8"))
    left_out = content["report"].get(LEFT_OUT, ())
    views = {name: view for name, view in content["cam_from_world"].items() if name not in left_out}
    true = {name: read_world_from_cam(capture / "pose" / f"{_number(name)}.txt") for name in views}
    found = {}
    for kind in KINDS:
        pairs = [(inverse_pose(np.array(view[kind])), true[name]) for name, view in views.items()]
        metres = np.array([np.linalg.norm(one[:3, 3] - other[:3, 3]) for one, other in pairs])
        apart = np.array([np.linalg.norm(one[:3, :3] - other[:3, :3]) for one, other in pairs])
        found[kind] = metres, np.degrees(2 * np.arcsin((apart / np.sqrt(8)).clip(0.0, 1.0)))
    return found


def _number(name: str) -> str:
    """Frames are numbered with zeros in front, files without."""
    return str(int(name)) if name.isdecimal() else name


@command_line("pose_errors")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="pose_errors", description="Say how far the poses of runs are from true ones."
    )
    parser.add_argument("capture", type=Path, help="folder with the true poses")
    parser.add_argument("runs", type=Path, nargs="+", help="folders of runs")
    options = parser.parse_args(arguments)
    for run in options.runs:
        for kind, (metres, degrees) in pose_errors(options.capture, run).items():
            print(
                f"{run.name}, {kind}: {100 * _rms(metres):.2f} cm, {_rms(degrees):.3f} deg (root mean square), "
                f"{100 * metres.max():.2f} cm, {degrees.max():.3f} deg (largest)"
            )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    sys.exit(main())
