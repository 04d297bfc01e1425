"""The network that corrects completed depth: it has seen where stereo and completion go wrong in rooms whose depth is
known."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np

from room2dgs.depth.network.session import session_of
from room2dgs.errors import InputError

NAME = "depth_correction.onnx"
MULTIPLE = 8  # of its input's height and width

# A frame's name and its (CHANNELS, h, w) evidence -> (h, w) float32 to add to ln depth, and (h, w) float32 relative
# error to be expected then.
Correct = Callable[[str, np.ndarray], tuple[np.ndarray, np.ndarray]]


def shipped_correction() -> Path:
    """Where depth_correction.onnx lies in this installation.

    Raises:
        InputError: it is not there.
    """
    path = Path(str(files("room2dgs.depth") / "network" / NAME))
    if not path.is_file():
        raise InputError(
            f"{path} is missing from this installation; install room2dgs again, or give prior.depth.correction=false"
        )
    return path


def correction_by_network() -> Correct:
    """What corrects a view; several threads may call it, and it gives the same bits however many do.

    Raises:
        InputError: the network is missing or damaged.
    """
    session = session_of(shipped_correction(), 1, "cpu")

    def correct(_name: str, evidence: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        height, width = evidence.shape[1:]
        margin = ((0, 0), (0, -height % MULTIPLE), (0, -width % MULTIPLE))
        shift, error = session.run(None, {"evidence": np.pad(evidence, margin)[None]})
        return shift[0, :height, :width], error[0, :height, :width]

    return correct
