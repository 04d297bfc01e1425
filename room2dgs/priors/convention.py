"""Which way a file's normals count: conversion to the house's convention, and a check that it is the right one.

The house has camera axes as OpenCV (x right, y down, z forward) and normals that face the camera: a wall seen
frontally is (0, 0, -1). Files in the wild have OpenGL axes (y up, z back), normals that point away, or the world
frame, and the wrong choice is the commonest fault of prior data.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from room2dgs.config import NormalPriorConfig
from room2dgs.scene.camera import Camera

AXES = {"opencv": (1.0, 1.0, 1.0), "opengl": (1.0, -1.0, -1.0)}
SIDES = {"camera": 1.0, "away": -1.0}
# A candidate must beat the present setting by so much: mean cosine against depth, share of pixels facing away.
CLEAR_COSINE = 0.2
CLEAR_SHARE = 0.08
# Below this mean cosine with the depth's normals nothing is known about either.
MIN_COSINE = 0.5
# Noise and grazing views turn a few normals away.
MAX_AWAY = 0.1


def camera_normals(raw: np.ndarray, settings: NormalPriorConfig, camera: Camera) -> np.ndarray:
    """Normals as in the file to the camera frame, OpenCV axes, facing the camera.

    Args:
        raw: (..., 3).
        settings: `axes` (camera frame only; a world frame is the capture's), `facing` and `frame`.
    """
    if settings.frame == "world":
        return SIDES[settings.facing] * raw @ camera.cam_from_world[:3, :3].T
    return raw * (SIDES[settings.facing] * np.array(AXES[settings.axes]))


@dataclass(frozen=True)
class Sample:
    """Some pixels of one frame.

    Attributes:
        raw: (N, 3) normals as in the file.
        rays: (N, 3) camera frame.
        from_depth: (N, 3) normals of the depth prior, camera frame, facing the camera; 0 where there are none.
        camera: of the frame.
    """

    raw: np.ndarray
    rays: np.ndarray
    from_depth: np.ndarray
    camera: Camera


@dataclass(frozen=True)
class Verdict:
    """What the check found.

    Attributes:
        away: fraction of pixels whose normal points away from the camera, n . ray > 0.
        cosine: mean cosine with the depth prior's normals; None without a depth prior.
        better: how to name the convention that fits clearly better ("prior.normal.axes=opengl"); None: the
            present one is as good as any.
    """

    away: float
    cosine: float | None
    better: str | None


def judge(samples: Iterable[Sample], settings: NormalPriorConfig) -> Verdict:
    """Compare the present convention with every other: axis flips, facing, frame."""
    samples = list(samples)
    scores = {name: _score(samples, settings, candidate) for name, candidate in _candidates(settings)}
    away, cosine = scores[""]
    if cosine is not None:
        best = max(scores, key=lambda name: scores[name][1])
        wrong = scores[best][1] >= MIN_COSINE and scores[best][1] - cosine > CLEAR_COSINE
        # Depth that says nothing leaves the question to the side alone.
        if wrong or max(score[1] for score in scores.values()) >= MIN_COSINE:
            return Verdict(away, cosine, best if wrong else None)
    best = min(scores, key=lambda name: scores[name][0])
    wrong = away > MAX_AWAY and away - scores[best][0] > CLEAR_SHARE
    return Verdict(away, cosine, best if wrong else None)


def _candidates(settings: NormalPriorConfig) -> list[tuple[str, tuple[NormalPriorConfig, np.ndarray]]]:
    """(name, (settings, (3,) flip of the camera's axes)); first the present one, named "", then what settings can
    say, then what only the files' maker can mend."""
    ones = np.ones(3)
    found = [("", (settings, ones))]
    seen = {_meaning(settings, ones)}
    for frame, axes, facing in product(("camera", "world"), AXES, SIDES):
        other = replace(settings, frame=frame, axes=axes, facing=facing)
        if _meaning(other, ones) not in seen:
            seen.add(_meaning(other, ones))
            keys = [key for key in ("frame", "axes", "facing") if getattr(other, key) != getattr(settings, key)]
            if frame == "world":
                keys = [key for key in keys if key != "axes"]
            found.append((" ".join(f"prior.normal.{key}={getattr(other, key)}" for key in keys), (other, ones)))
    for flip in product((1.0, -1.0), repeat=3):
        if settings.frame == "camera" and _meaning(settings, np.array(flip)) not in seen:
            seen.add(_meaning(settings, np.array(flip)))
            axes = " and ".join(name for name, sign in zip("xyz", flip, strict=True) if sign < 0)
            found.append((f"the files with {axes} negated", (settings, np.array(flip))))
    return found


def _meaning(settings: NormalPriorConfig, flip: np.ndarray) -> tuple:
    if settings.frame == "world":
        return ("world", settings.facing, *flip)
    return ("camera", *(SIDES[settings.facing] * np.array(AXES[settings.axes]) * flip))


def _score(
    samples: list[Sample], settings: NormalPriorConfig, candidate: tuple[NormalPriorConfig, np.ndarray]
) -> tuple[float, float | None]:
    """(share of pixels that face away, mean cosine with the depth's normals or None)."""
    other, flip = candidate
    away, cosines = [], []
    for sample in samples:
        normal = camera_normals(sample.raw, other, sample.camera) * flip
        away.append((normal * sample.rays).sum(axis=-1) > 0)
        known = sample.from_depth.any(axis=-1)
        cosines.append((normal * sample.from_depth).sum(axis=-1)[known])
    cosines = np.concatenate(cosines) if cosines else np.zeros(0)
    return float(np.concatenate(away).mean()), float(cosines.mean()) if len(cosines) else None
