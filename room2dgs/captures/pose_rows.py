"""Text files with a list of poses, each in one or several lines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import damaged
from room2dgs.captures.text_files import floats, lines_of
from room2dgs.errors import InputError

LAST_ROW = (0.0, 0.0, 0.0, 1.0)
PoseRows = list[np.ndarray | Callable[[], np.ndarray]]


def pose_rows(path: Path, lines_a_pose: int) -> tuple[PoseRows, InputError | None]:
    """Poses of 16 numbers each, row by row; of 12 where the last row is left out of all.

    Returns:
        (4, 4) for each pose, or what a damaged one's photo has instead; and the first one's damage, None: all are
        whole. A damaged line may be one too many, which moves all that follow (`pairing.places` takes that in).

    Raises:
        InputError: the lines do not divide into poses.
    """
    lines = lines_of(path)
    if len(lines) % lines_a_pose:
        raise InputError(f"{path} has {len(lines)} lines, {lines_a_pose} a pose belong there; copy it again")
    numbers = _numbers_a_pose(lines) if lines_a_pose == 1 else 16
    poses: PoseRows = []
    first = None
    for start in range(0, len(lines), lines_a_pose):
        try:
            part = lines[start : start + lines_a_pose]
            rows = [floats(text, path, line, numbers // lines_a_pose) for line, text in part]
            poses.append(np.concatenate([np.array(rows).ravel(), LAST_ROW])[:16].reshape(4, 4))
        except InputError as error:
            poses.append(damaged(error))
            first = first or error
    return poses, first


def _numbers_a_pose(lines: list[tuple[int, str]]) -> int:
    """12 where most lines have so many, else 16."""
    short = sum(len(text.replace(",", " ").split(maxsplit=16)) == 12 for _, text in lines)
    return 12 if 2 * short > len(lines) else 16
