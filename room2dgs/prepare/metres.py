"""Metres of one unit of a reconstruction, from a sensor's depth, a known length or the depth network."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from room2dgs.captures.listing import natural
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import seen_points
from room2dgs.captures.selection import evenly_spaced
from room2dgs.errors import InputError
from room2dgs.lengths.targets import length_of
from room2dgs.logs import Log
from room2dgs.prepare.progress import Progress

LEAST_POINTS = 20  # of a photo
MOST_PHOTOS = 60
SCALE_QUANTILES = 0.05, 0.95
LEAST_SCALES = 5  # photos: fewer say nothing of their spread
# What our network is off by in a room as a whole, however well its photos agree (see its
# README).
NETWORK_SIGMA = 0.3
SENSOR_SIGMA = 0.01
HEIGHT_SIGMA = 0.03  # of where the floor is found
FLOOR_BINS = 60  # of the heights from the cameras down to the lowest points
FLOOR_PEAK = 4.0  # times as full as the levels around it: the lowest such level is the floor
FLOOR_SHARE = 0.03  # of all points below the cameras

DepthOf = Callable[[Frame], tuple[np.ndarray, np.ndarray] | None]


@dataclass(frozen=True)
class Scale:
    """Metres of one unit.

    Attributes:
        metres: of one unit.
        source: "sensor", "length" or "network".
        sigma: relative; None: unknown.
        photos: number of photos that it was measured in.
        words: a sentence for the verdict.
        ratio: 95th over 5th percentile of what single photos tell; None: too few do.
    """

    metres: float
    source: str
    sigma: float | None
    photos: int
    words: str
    ratio: float | None = None

    def as_dict(self) -> dict:
        return asdict(self)


def scale_by_maps(
    frames: Sequence[Frame], points: PointCloud, depth_of: DepthOf, source: str, floor: float, log: Log
) -> Scale | None:
    """The median over photos of the median ratio of a map's depth to the points' depth.

    Args:
        frames, points: in one unit that is not known.
        depth_of: (H, W) depth in metres and where it is valid, at the frame's size; None: there is none.
        floor: relative error that all photos share.

    Returns:
        None where hardly any photo has both.
    """
    chosen = evenly_spaced(frames, MOST_PHOTOS)
    progress = Progress(log, f"scale by the {source}", len(chosen), "photos")
    logs = []
    for count, frame in enumerate(chosen, 1):
        ratio = photo_ratio(frame, points, depth_of)
        if ratio is not None:
            logs.append(np.log(ratio))
        progress.at(count)
    if len(logs) < 3:
        return None
    median = float(np.median(logs))
    spread = 1.4826 * float(np.median(np.abs(np.array(logs) - median)))
    sigma = float(np.hypot(floor, spread / np.sqrt(len(logs))))
    return Scale(
        float(np.exp(median)),
        source,
        sigma,
        len(logs),
        f"{len(logs)} photos compared, which spread by {spread:.0%}",
        float(np.exp(np.ptp(np.quantile(logs, SCALE_QUANTILES)))) if len(logs) >= LEAST_SCALES else None,
    )


def photo_ratio(frame: Frame, points: PointCloud, depth_of: DepthOf) -> float | None:
    """Median of map / points in one photo; None with too few points."""
    seen = seen_points(points, frame)
    if len(seen.index) < LEAST_POINTS:
        return None
    found = depth_of(frame)
    if found is None:
        return None
    column, row = seen.column_row
    valid = found[1][row, column]
    if valid.sum() < LEAST_POINTS:
        return None
    return float(np.exp(np.median(np.log(found[0][row, column][valid] / seen.depth[valid]))))


def scale_by_length(
    length: Sequence[str], centres: dict[str, np.ndarray], seconds: dict[str, float], height: float | None
) -> Scale:
    """From `prepare.length`.

    Args:
        length: [METRES] of the cameras' path, [height, METRES] of the cameras over the floor, or [PHOTO, PHOTO, METRES]
            between two cameras, METRES with a standard deviation if that is known: 2.04+-0.01. A photo is named, or its
            number, or its time in the video as 12.5s.
        centres: of the placed photos, in order, by name.
        seconds: of photos of a video.
        height: of the cameras over the floor, in the model's unit; None: no floor is seen.

    Raises:
        InputError: no such photo, no number, or cameras in one place.
    """
    metres, own = length_of(length[-1], "prepare.length")
    own = None if own is None else own / metres
    if len(length) == 1:
        path = np.array([centres[name] for name in natural(centres)])
        found = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        words = f"the cameras' path is {metres:g} m long"
    elif len(length) == 2 and length[0] == "height":
        if height is None:
            raise InputError("prepare.length=[height,...] needs a floor, and none is seen; give [PHOTO,PHOTO,METRES]")
        sigma = float(np.hypot(HEIGHT_SIGMA, own or 0.0))
        return Scale(metres / height, "length", sigma, len(centres), f"cameras {metres:g} m over the floor")
    elif len(length) == 3:
        first, second = (_named(text, centres, seconds) for text in length[:2])
        found = float(np.linalg.norm(centres[first] - centres[second]))
        words = f"{first} and {second} were taken {metres:g} m apart"
    else:
        raise InputError("prepare.length wants [METRES], [height,METRES] or [PHOTO,PHOTO,METRES]")
    typical = np.median(
        [np.linalg.norm(c) for c in np.array(list(centres.values())) - np.mean(list(centres.values()), 0)]
    )
    if not found > 0.05 * typical:
        raise InputError(f"prepare.length={_shown(length)} names cameras in one place; name two that are far apart")
    return Scale(metres / found, "length", own, 2 if len(length) == 3 else len(centres), words)


def height_over_floor(xyz: np.ndarray, centres: np.ndarray) -> float | None:
    """Height of the cameras over the lowest level with many points; None without one.

    Args:
        xyz, centres: (P, 3) points and (N, 3) cameras, z up, any unit.
    """
    below = float(np.median(centres[:, 2])) - xyz[:, 2]
    below = below[below > 0]
    if len(below) < 200:
        return None
    reach = float(np.quantile(below, 0.98)) * 1.1
    counts, edges = np.histogram(below[below < reach], FLOOR_BINS, (0.0, reach))
    smooth = np.convolve(counts, [0.5, 1.0, 0.5], "same")
    levels = [i for i in range(1, FLOOR_BINS - 1) if _stands_out(smooth, i) and smooth[i] >= FLOOR_SHARE * len(below)]
    if not levels:
        return None
    near = np.abs(below - (edges[levels[-1]] + edges[levels[-1] + 1]) / 2) < 1.5 * (edges[1] - edges[0])
    return float(np.median(below[near]))


def _stands_out(smooth: np.ndarray, i: int) -> bool:
    """A level is fuller than those around it, not counting those next to it."""
    around = np.concatenate([smooth[max(0, i - 8) : max(0, i - 2)], smooth[i + 3 : i + 9]])
    peak = smooth[i] >= smooth[i - 1] and smooth[i] >= smooth[i + 1]
    return bool(peak and smooth[i] > FLOOR_PEAK * np.median(around))


def _named(text: str, centres: dict[str, np.ndarray], seconds: dict[str, float]) -> str:
    """The placed photo that a name, a number or a time means."""
    for name in centres:
        if text in (name, Path(name).stem):
            return name
    if text.isdigit():
        found = [
            name for name in centres if (parts := re.findall(r"\d+", Path(name).stem)) and int(parts[-1]) == int(text)
        ]
        if len(found) == 1:
            return found[0]
    placed = {name: time for name, time in seconds.items() if name in centres}
    if placed and re.fullmatch(r"\d+(\.\d+)?s", text):
        time = float(text[:-1])
        name = min(placed, key=lambda name: abs(placed[name] - time))
        if abs(placed[name] - time) <= 1.0:
            return name
    some = ", ".join(list(centres)[:3])
    raise InputError(f"prepare.length names {text}, which is none of the placed photos ({some}, ...); name two of them")


def _shown(length: Sequence[str]) -> str:
    return "[" + ",".join(length) + "]"
