"""What metrics.json may hold, whoever wrote it: the one door for all that reads a run's figures."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from room2dgs.errors import InputError

LARGEST = 1e15  # of any figure; beyond it nothing is a length, a time or a count
Test = Callable[[Any], bool]


class Kind(NamedTuple):
    """What a value may be: a name for it, and a test."""

    name: str
    fits: Test


def checked(metrics: dict[str, Any], path: Path) -> dict[str, Any]:
    """The figures, if those that anybody reads are of their kinds; null stands for none and is left out of no key.

    Raises:
        InputError: names the first key that is not.
    """
    for key, value in metrics.items():
        kind = _kind_of(key)
        if kind is not None and value is not None and not kind.fits(value):
            raise InputError(f"{path}: {key} is no {kind.name}; delete the file, then make the figures again")
    return metrics


def is_number(value: Any) -> bool:
    """A finite number of a sensible size; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_object(value: Any) -> bool:
    return isinstance(value, dict)


def _each(test: Test) -> Test:
    return lambda value: isinstance(value, dict) and all(map(test, value.values()))


def _or_none(test: Test) -> Test:
    return lambda value: value is None or test(value)


def _is_scalar(value: Any) -> bool:
    return value is None or isinstance(value, str | bool) or is_number(value)


def _is_exposure(value: Any) -> bool:
    """Of the photos, as far as it is read again: three factors above 0 for each."""

    def factors(one: Any) -> bool:
        return isinstance(one, list) and len(one) == 3 and all(is_number(x) and 0 < x < math.inf for x in one)

    return isinstance(value, dict) and _each(factors)(value.get("gains", {}))


def _is_pose(value: Any) -> bool:
    rows = isinstance(value, list) and len(value) == 4
    return rows and all(isinstance(row, list) and len(row) == 4 and all(map(is_number, row)) for row in value)


def _is_alignment(value: Any) -> bool:
    return _is_text(value) or (isinstance(value, dict) and _is_pose(value.get("truth_from_pred")))


def _are_scores(value: Any) -> bool:
    """Of one protocol."""
    if not isinstance(value, dict):
        return False
    figures = (one for key, one in value.items() if key != "constants")
    return _is_object(value.get("constants", {})) and all(map(_or_none(is_number), figures))


def _are_sites(value: Any) -> bool:
    """Where the error sits, as far as it is read again."""
    part = value.get("precision") if isinstance(value, dict) else None
    if not isinstance(part, dict) or not is_number(part.get("wrong")):
        return False
    farther = part.get("by_distance")
    return bool(farther) and _each(lambda one: isinstance(one, dict) and is_number(one.get("wrong")))(farther)


def _are_depth_scores(value: Any) -> bool:
    """Of protocol `depth`, as far as they are read again: figures by group of photos for each surface."""
    surfaces = [one for key, one in value.items() if key != "constants"] if isinstance(value, dict) else [None]
    groups = _each(_each(_or_none(is_number)))
    return all(
        isinstance(one, dict) and groups({key: group for key, group in one.items() if key != "by_view"})
        for one in surfaces
    )


def _is_quality(value: Any) -> bool:
    """How whole a mesh is: figures, and holes by size."""
    if not isinstance(value, dict):
        return False
    return _each(is_number)(value.get("holes", {})) and all(
        one is None or is_number(one) for key, one in value.items() if key != "holes"
    )


def _is_verdict(value: Any) -> bool:
    if not isinstance(value, dict) or not _is_text(value.get("word")):
        return False
    lists = (value.get("reasons"), value.get("advice"), value.get("notes", []))
    texts = all(isinstance(one, list) and all(map(_is_text, one)) for one in lists)
    return texts and _each(_or_none(_is_measure))(value.get("measures", {}))


def _is_measure(value: Any) -> bool:
    return isinstance(value, bool) or is_number(value)


NUMBER, TEXT = Kind("number", is_number), Kind("text", _is_text)
NUMBERS, OBJECT = Kind("object of numbers", _each(is_number)), Kind("object", _is_object)
BY_BEGINNING = {"f_score_": NUMBER, "precision_": NUMBER, "recall_": NUMBER}
BY_KEY = {
    **dict.fromkeys(("accuracy_m", "completion_m", "chamfer_m", "normal_consistency", "depth_to_truth_m"), NUMBER),
    **dict.fromkeys(("psnr_db", "psnr_fitted_db", "ssim"), NUMBER),
    **dict.fromkeys(("primitives", "seeds", "iterations", "points", "stereo_coverage"), NUMBER),
    **dict.fromkeys(("mesh_faces", "mesh_vertices", "mesh_voxel_m", "peak_memory_mb", "report_mb"), NUMBER),
    "threshold_m": Kind("number above 0", lambda value: is_number(value) and value > 0 and math.isfinite(1 / value)),
    **dict.fromkeys(("protocol", "priors", "depth_source", "commit", "primitives_called"), TEXT),
    **dict.fromkeys(("seconds", "cpu_seconds", "stage_peak_memory_mb", "training_seconds", "eval_seconds"), NUMBERS),
    "prior_seconds": Kind("object of objects of numbers", _each(_each(is_number))),
    "versions": Kind("object of texts", _each(_is_text)),
    "machine": Kind("object of numbers and texts", _each(_is_scalar)),
    "boundary_m": NUMBERS,
    **dict.fromkeys(("capture", "poses", "unit"), OBJECT),
    "exposure": Kind("object with gains of three numbers above 0 by photo", _is_exposure),
    "verdict": Kind("object of a word, reasons, advice and measures", _is_verdict),
    "test_views": Kind("object or list", lambda value: isinstance(value, dict | list)),
    "truth_from_same_depth": Kind("true or false", lambda value: isinstance(value, bool)),
    "align": Kind("text or object with a matrix truth_from_pred of 4 by 4", _is_alignment),
    "protocols": Kind("object of scores by protocol", _each(_are_scores)),
    "mesh_quality": Kind("object of numbers", _is_quality),
    "depth_scores": Kind("object of depth scores by surface", _are_depth_scores),
    "where_the_error_sits": Kind("breakdown of the error", _are_sites),
}


def _kind_of(key: str) -> Kind | None:
    """None: nobody reads it."""
    beginning = next((kind for start, kind in BY_BEGINNING.items() if key.startswith(start)), None)
    return BY_KEY.get(key, beginning)
