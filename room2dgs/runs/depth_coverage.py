"""How much of each photo has depth, and of what: coverage.json of `room2dgs depth`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from room2dgs.captures.view_maps import ViewMaps, valid_depth
from room2dgs.json_files import update_json
from room2dgs.runs.metrics import StageTimes, by_stage, commit, machine, versions

if TYPE_CHECKING:
    from room2dgs.stereo.dense import DenseView

COVERAGE = "coverage.json"
SURE = 0.5  # confidence: the expected error is then 2.5 % of the depth


@dataclass(frozen=True)
class Coverage:
    """Of one photo, or of all.

    Attributes:
        photo: the view's name, which its maps have too; "all".
        stereo: share of the pixels that stereo kept.
        num_consistent: number of consistent photos -> share of the pixels on which so many agree; the shares add up to
            `stereo`.
        error_m: median of the errors that stereo expects, metres; None where it kept nothing.
        filled: share of the pixels that have depth without stereo's; None: nothing was filled.
        filled_sure: share of the pixels that are filled with a confidence of at least `SURE`; likewise.
    """

    photo: str
    stereo: float
    num_consistent: dict[int, float]
    error_m: float | None
    filled: float | None = None
    filled_sure: float | None = None


def photo_coverage(photo: str, view: DenseView, maps: ViewMaps[np.ndarray] | None = None) -> Coverage:
    """Coverage of one photo.

    Args:
        maps: the filled depth, of any size; None: nothing was filled.
    """
    kept = view.depth > 0
    counts = np.bincount(view.num_consistent[kept])
    num_consistent = {int(count): float(counts[count] / kept.size) for count in np.flatnonzero(counts)}
    error = float(np.median(view.error[kept])) if kept.any() else None
    filled = sure = None
    if maps is not None and maps.depth is not None:
        by_stereo = cv2.resize(kept.astype(np.uint8), maps.depth.shape[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
        added = valid_depth(maps.depth) & (by_stereo == 0)
        confidence = 1.0 if maps.depth_confidence is None else maps.depth_confidence
        filled, sure = float(added.mean()), float((added & (confidence >= SURE)).mean())
    return Coverage(photo, float(kept.mean()), num_consistent, error, filled, sure)


def total(photos: Sequence[Coverage]) -> Coverage:
    """Means of the shares, each photo with the same weight; of the expected errors the median of the photos'."""
    counts = sorted({count for one in photos for count in one.num_consistent})
    errors = [one.error_m for one in photos if one.error_m is not None]
    return Coverage(
        "all",
        float(np.mean([one.stereo for one in photos])),
        {count: float(np.mean([one.num_consistent.get(count, 0.0) for one in photos])) for count in counts},
        float(np.median(errors)) if errors else None,
        _mean([one.filled for one in photos]),
        _mean([one.filled_sure for one in photos]),
    )


def write_coverage(out: Path, photos: Sequence[Coverage], times: StageTimes) -> None:
    """out/coverage.json."""
    (out / COVERAGE).unlink(missing_ok=True)
    whole = {
        "total": asdict(total(photos)),
        "seconds": by_stage(times),
        "photos": [asdict(one) for one in photos],
        "machine": machine(),
        "commit": commit(),
        "versions": versions(),
    }
    update_json(out / COVERAGE, whole)


def counted(num_consistent: Mapping[int, float], least: int, most: int | None = None) -> float:
    """Share of the pixels on which so many photos agree, `most` included; None: any number."""
    return sum(share for count, share in num_consistent.items() if count >= least and (most is None or count <= most))


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    # a photo without filled depth has none filled
    return float(sum(known) / len(values)) if known else None
