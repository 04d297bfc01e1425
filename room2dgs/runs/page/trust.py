"""Where the depth of a run came from and how far it was trusted, in small maps of the training views."""

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
SURE = 3  # photos that must agree for stereo to stand in its own right, as completion has it
STEREO, PRIOR, NOTHING = np.array([60, 170, 80]), np.array([70, 120, 220]), np.array([30, 30, 30])


class Trust(NamedTuple):
    """One view's small maps.

    Attributes:
        confidence: (h, w) uint8, of 255: in the depth that the losses compare with; 0 = no depth.
        agreeing: (h, w) uint8: photos that agree with stereo's depth; 0 = none.
    """

    confidence: np.ndarray
    agreeing: np.ndarray


def chosen(frames: Sequence[Frame], most: int) -> list[Frame]:
    """At most so many frames, evenly spaced."""
    if not frames or most < 1:
        return []
    return [frames[index] for index in np.unique(np.linspace(0, len(frames) - 1, most).round().astype(int))]


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


def picture(one: Trust) -> np.ndarray:
    """(h, w, 3) uint8: green where stereo stands in its own right, else blue; as bright as it is trusted."""
    sure = one.confidence[..., None] / 255
    source = np.where((one.agreeing >= SURE)[..., None], STEREO, PRIOR)
    return np.round(NOTHING + (source - NOTHING) * sure).astype(np.uint8)


def key(source: str) -> list[tuple[str, str]]:
    """Colours of the picture and what they mean."""
    return [
        (_css(STEREO), f"stereo: {SURE} photos or more agree"),
        (_css(PRIOR), other_source(source)),
        (_css(NOTHING), "not trusted, or no depth"),
        ("", "The brighter, the more it is trusted."),
    ]


def stereo_key() -> list[tuple[str, str]]:
    """Likewise where stereo is the only source."""
    return [
        (_css(STEREO), "stereo: the brighter, the more photos agree"),
        (_css(NOTHING), "no depth"),
    ]


def other_source(source: str) -> str:
    """The prior's source (`Priors.depth_source`) in words."""
    words = {
        "sensor": "the capture's depth camera",
        "files": "depth files",
        "stereo": "stereo: fewer photos agree",
        "none": "no other source",
    }
    return words.get(source, f"network ({source})")


def sentences(maps: Mapping[str, Trust], source: str) -> list[str]:
    """Shares over the views that maps were kept of."""
    if not maps:
        return []
    stereo = np.concatenate([(one.agreeing >= SURE).ravel() for one in maps.values()])
    confidence = np.concatenate([one.confidence.ravel() for one in maps.values()]) / 255
    lines = [f'Measured on {len(maps)} training views; their pictures are above, under "where depth was trusted".']
    if source != "sensor":
        lines.append(
            f"Stereo stands in its own right ({SURE} photos or more agree) in {stereo.mean():.0%} of the pixels; "
            f"trusted {_mean(confidence[stereo]):.0%} there on average."
        )
    rest = ~stereo & (confidence > 0)
    if source == "stereo":
        return [*lines, f"In {rest.mean():.0%} fewer agree; {np.mean(confidence == 0):.0%} have no depth."]
    lines.append(
        f"{rest.mean():.0%} have depth of {other_source(source)} alone, trusted {_mean(confidence[rest]):.0%}."
    )
    lines.append(f"{np.mean(confidence == 0):.0%} have no depth but what training finds from the photos.")
    return lines


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else 0.0


def _css(color: np.ndarray) -> str:
    return f"rgb({', '.join(str(int(part)) for part in color)})"
