"""The box room as a capture with a depth camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest


@pytest.fixture
def with_depth(room, tmp_path: Path):
    """`with_depth(changed)` writes 16-bit millimetres for each frame and gives the frames.

    changed: (depth in metres, number of the frame) -> depth in metres, of any size; None: no file.
    """

    def write(changed=lambda depth, i: depth, unit_m: float = 0.001) -> list:
        folder = tmp_path / "depth"
        folder.mkdir(exist_ok=True)
        frames = []
        for i, (frame, exact) in enumerate(zip(room.frames, room.depths, strict=True)):
            depth, path = changed(exact, i), folder / f"{frame.name}.png"
            if depth is not None:
                cv2.imwrite(str(path), np.round(depth / unit_m).clip(0, 65535).astype(np.uint16))
            frames.append(replace(frame, depth_path=None if depth is None else path))
        return frames

    return write
