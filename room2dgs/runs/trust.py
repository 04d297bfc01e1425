"""How far the depth of each training view was trusted, in small maps that a run keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.files import NUMPY_DAMAGE, whole_file

COLUMNS = 160


class Trust(NamedTuple):
    """One view's small maps.

    Attributes:
        confidence: (h, w) uint8, of 255: in the depth that the losses compare with; 0 = no depth.
        agreeing: (h, w) uint8: how many photos that agree stereo's depth is worth; 0 = none.
    """

    confidence: np.ndarray
    agreeing: np.ndarray


def write_trust(
    path: Path,
    frames: Sequence[Frame],
    maps: Mapping[str, ViewMaps],
    stereo: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> None:
    """Keeps small maps of all views; no file where no view has depth.

    Args:
        frames: training views.
        maps: frame name -> priors.
        stereo: frame name -> depth, metres, and agreeing views; may be empty.
    """
    arrays: dict[str, np.ndarray] = {}
    names = []
    for frame in frames:
        found = maps.get(frame.name)
        if found is None or found.depth is None:
            continue
        confidence = (found.depth > 0).astype(np.float32)
        if found.depth_confidence is not None:
            confidence = np.clip(found.depth_confidence, 0, 1).astype(np.float32)
        small = frame.camera.resized_to_width(min(COLUMNS, frame.camera.width)).size
        confidence = cv2.resize(confidence, small, interpolation=cv2.INTER_AREA)
        agreeing = np.zeros(confidence.shape, np.uint8)
        if frame.name in stereo:
            depth, count = stereo[frame.name]
            count = np.where(depth > 0, np.minimum(count, 255), 0).astype(np.uint8)
            agreeing = cv2.resize(count, small, interpolation=cv2.INTER_NEAREST_EXACT)
        least = confidence > 0  # of a depth that hardly anything speaks for, too
        arrays[f"{len(names)}/confidence"] = np.maximum(np.round(confidence * 255), least).astype(np.uint8)
        arrays[f"{len(names)}/agreeing"] = agreeing
        names.append(frame.name)
    path.unlink(missing_ok=True)
    if names:
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, names=np.array(names), **arrays)


def read_trust(path: Path) -> dict[str, Trust]:
    """Frame name -> maps; none without the file, or when it is damaged: the page does without."""
    try:
        with np.load(path, allow_pickle=False) as file:
            names = [str(name) for name in file["names"]]
            return {
                name: Trust(file[f"{index}/confidence"], file[f"{index}/agreeing"]) for index, name in enumerate(names)
            }
    except NUMPY_DAMAGE:
        return {}
