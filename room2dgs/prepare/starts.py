"""The reconstruction from several focal lengths to start with, where the first one does not tell enough."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.colmap import pycolmap
from room2dgs.logs import Log
from room2dgs.prepare.features import FOCAL, set_focal, verified_pairs
from room2dgs.prepare.focal import Focal, is_determined, measured_focal, weighed
from room2dgs.prepare.loose import loose_photos, remove_photos
from room2dgs.prepare.merge import merged
from room2dgs.prepare.one_place import FLAT, TURNED, without_parallax
from room2dgs.prepare.photos import ChosenPhoto

STARTS = (0.6, 1.1, 1.6)  # of the longer side, beside the usual one
MAX_ERROR_PX = 4.0  # of an observation, as the mapping allows
ALIKE = 0.03  # support of models that are as good as each other differs by less
Mapping = Callable[[], list[pycolmap.Reconstruction]]


class Start(NamedTuple):
    """What came of one start.

    Attributes:
        model, others: the largest model, and those that do not join it.
        loose: number of photos that were left out of it.
        focal: as measured in the model.
    """

    model: pycolmap.Reconstruction
    others: list[pycolmap.Reconstruction]
    loose: int
    focal: Focal


def best_start(
    mapping: Mapping, photos: Sequence[ChosenPhoto], database: Path, images: Path, work: Path, known: bool, log: Log
) -> Start | None:
    """The usual start if its photos determine the focal length; else the best of several, weighed with what is likely.

    Args:
        mapping: from the focal lengths in the database.
        known: the intrinsics were given, and stay as they are.

    Returns:
        None if no start gives a model.
    """

    def tried() -> Start | None:
        models = mapping()
        if not models:
            return None
        model, others = merged(models, database, images, work, known, log)
        loose = loose_photos(model)
        remove_photos(model, loose)
        focal = Focal(_given_px(model)) if known else measured_focal(model, photos)
        return Start(model, others, len(loose), focal)

    if known:
        return tried()
    set_focal(database, photos, FOCAL)
    first = tried()
    if first is not None and is_determined(first.focal, first.model):
        return first
    found = [] if first is None else [first]
    # from one place a wrong focal length makes up a room
    for start in () if without_parallax(verified_pairs(database), {TURNED, FLAT}) else STARTS:
        log(f"focal length: the photos hardly tell it; another start, from {start:g} of their longer side")
        set_focal(database, photos, start)
        other = tried()
        found += [] if other is None else [other]
    if not found:
        return None
    best, alike = chosen(found)
    return best._replace(focal=weighed(best.model, best.focal, images, [one.focal.px for one in alike]))


def chosen(found: Sequence[Start]) -> tuple[Start, list[Start]]:
    """The start with most support, of those that have as much the one with the likeliest focal length; and the others
    that have as much.
    """
    support = np.array([supported(start.model) for start in found])
    good = [start for start, value in zip(found, support, strict=True) if value >= (1 - ALIKE) * support.max()]
    best = min(good, key=_unlikely)
    return best, [start for start in good if start is not best]


def supported(model: pycolmap.Reconstruction) -> float:
    """Number of observations that fit, each counting the less the larger its error is (as in MSAC)."""
    error = np.array([point.error for point in model.points3D.values()])
    length = np.array([point.track.length() for point in model.points3D.values()])
    return float((length * np.maximum(0, 1 - (error / MAX_ERROR_PX) ** 2)).sum())


def _unlikely(start: Start) -> float:
    camera = max(start.model.cameras.values(), key=lambda camera: camera.width * camera.height)
    likely = start.focal.exif or FOCAL * max(camera.width, camera.height)
    return abs(float(np.log(start.focal.px / likely)))


def _given_px(model: pycolmap.Reconstruction) -> float:
    return float(np.median([camera.mean_focal_length() for camera in model.cameras.values()]))
