"""Which way a file's normals count: conversion to the house's convention, and a check that it is the right one.

The house has camera axes as OpenCV (x right, y down, z forward) and normals that face the camera: a wall seen
frontally is (0, 0, -1). Files in the wild have OpenGL axes (y up, z back), normals that point away, or the world
frame, and the wrong choice is the commonest fault of prior data.

Three things tell a wrong choice: what is seen faces the camera; a depth prior has normals of its own; and a point
that several views see has one normal in the world, which a wrong axis breaks as soon as the camera turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from room2dgs.config import NormalPriorConfig
from room2dgs.depth.normals.samples import Sample, view_pairs
from room2dgs.geometry.camera import Camera

# right or left, down or up, forward or back
_SIGNS = {"r": 1.0, "l": -1.0, "d": 1.0, "u": -1.0, "f": 1.0, "b": -1.0}
_LETTERS = ("".join(letters) for letters in product("rl", "du", "fb"))
AXES = {
    "opencv": (1.0, 1.0, 1.0),
    "opengl": (1.0, -1.0, -1.0),
    **{letters: tuple(_SIGNS[letter] for letter in letters) for letters in _LETTERS},
}
SIDES = {"camera": 1.0, "away": -1.0}
# A candidate must beat the present setting by so much: mean cosine against depth, between views, share of pixels
# facing away.
CLEAR_COSINE = 0.2
CLEAR_AGREEMENT = 0.08
CLEAR_SHARE = 0.08
# Below this mean cosine with the depth's normals, or between views, nothing is known about either.
MIN_COSINE = 0.5
# Noise and grazing views turn a few normals away.
MAX_AWAY = 0.1
# Fewer pairs of views of a point are no evidence.
MIN_PAIRS = 100


def camera_normals(raw: np.ndarray, settings: NormalPriorConfig, camera: Camera) -> np.ndarray:
    """Normals as in the file to the camera frame, OpenCV axes, facing the camera.

    Args:
        raw: (..., 3).
        settings: `axes` (camera frame only; a world frame is the capture's), `facing` and `frame`.
    """
    if settings.frame == "world":
        return camera.turned_to_camera(_side(settings) * raw)
    return raw * _signs(settings)


def _side(settings: NormalPriorConfig) -> float:
    assert settings.facing is not None
    return SIDES[settings.facing]


def _signs(settings: NormalPriorConfig) -> np.ndarray:
    """(3,) of x, y and z."""
    assert settings.axes is not None
    return _side(settings) * np.array(AXES[settings.axes])


@dataclass(frozen=True)
class Score:
    """How well one convention fits.

    Attributes:
        away: fraction of pixels whose normal points away from the camera, n . ray > 0.
        cosine: mean cosine with the depth prior's normals; None without a depth prior.
        agreement: mean cosine between two views' normals of the same point, in the world; None where too few
            points are seen twice. Noise that faces the camera has at most 0.25.
    """

    away: float
    cosine: float | None
    agreement: float | None


@dataclass(frozen=True)
class Verdict:
    """What the check found.

    Attributes:
        score: of the present convention.
        better: how to name the convention that fits clearly better ("prior.normal.axes=opengl"); None: the
            present one is as good as any.
        agreement: the best of any convention; None if unknown.
    """

    score: Score
    better: str | None
    agreement: float | None


def judge(samples: Sequence[Sample], settings: NormalPriorConfig) -> Verdict:
    """Compare the present convention with every other: axes, facing, frame."""
    pairs = view_pairs(samples)
    scores = {name: _score(samples, pairs, candidate) for name, candidate in _candidates(settings).items()}
    present = scores[""]
    known = [score.agreement for score in scores.values() if score.agreement is not None]
    return Verdict(present, _better(scores, present), max(known, default=None))


def _better(scores: dict[str, Score], present: Score) -> str | None:
    if present.cosine is not None:
        cosines = {name: score.cosine for name, score in scores.items() if score.cosine is not None}
        best = max(cosines, key=lambda name: cosines[name])
        # Depth without information leaves the question to the other tests.
        if cosines[best] >= MIN_COSINE:
            return best if cosines[best] - present.cosine > CLEAR_COSINE else None
    least_away = min(score.away for score in scores.values())
    turned = present.away > MAX_AWAY and present.away - least_away > CLEAR_SHARE
    # Turning all normals round changes no agreement between views: the side decides that first.
    facing = [name for name, score in scores.items() if score.away <= max(MAX_AWAY, least_away)]
    if present.agreement is not None:
        agreements = {name: agreement for name in facing if (agreement := scores[name].agreement) is not None}
        best = max(agreements, key=lambda name: agreements[name])
        gain = agreements[best] - present.agreement
        if agreements[best] >= MIN_COSINE:
            return best if gain > CLEAR_AGREEMENT or (turned and gain > -CLEAR_AGREEMENT / 2) else None
    return min(scores, key=lambda name: scores[name].away) if turned else None


def _candidates(settings: NormalPriorConfig) -> dict[str, NormalPriorConfig]:
    """Name -> settings of every convention, each once; first the present one, named ""."""
    found, seen = {"": settings}, {_meaning(settings)}
    for frame, axes, facing in product(("camera", "world"), AXES, SIDES):
        changed: dict[str, Any] = {"frame": frame, "axes": axes, "facing": facing}
        other = replace(settings, **changed)
        if _meaning(other) in seen:
            continue
        seen.add(_meaning(other))
        keys = [key for key in ("frame", "axes", "facing") if getattr(other, key) != getattr(settings, key)]
        if frame == "world":
            keys = [key for key in keys if key != "axes"]
        found[" ".join(f"prior.normal.{key}={getattr(other, key)}" for key in keys)] = other
    return found


def _meaning(settings: NormalPriorConfig) -> tuple:
    if settings.frame == "world":
        return ("world", settings.facing)
    return ("camera", *_signs(settings))


def _score(samples: Sequence[Sample], pairs: np.ndarray, settings: NormalPriorConfig) -> Score:
    away, cosines, in_world = [], [], []
    for sample in samples:
        normal = camera_normals(sample.raw, settings, sample.camera)
        away.append((normal * sample.rays).sum(axis=-1) > 0)
        known = sample.from_depth.any(axis=-1)
        cosines.append((normal * sample.from_depth).sum(axis=-1)[known])
        in_world.append(sample.camera.turned_to_world(normal))
    cosine, world = np.concatenate(cosines), np.concatenate(in_world)
    between = (world[pairs[:, 0]] * world[pairs[:, 1]]).sum(axis=-1)
    return Score(
        float(np.concatenate(away).mean()),
        float(cosine.mean()) if len(cosine) else None,
        float(between.mean()) if len(pairs) >= MIN_PAIRS else None,
    )
