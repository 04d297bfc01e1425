"""Which settings decide a run's result, so that a resumed run is the same run."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.regular_files import open_regular
from room2dgs.train.prior_maps import priors_digest
from room2dgs.train.schedule import has_shares

# `train.iterations` is not among them, unless times are shares of it: a run may be prolonged.
SECTIONS = ("scene", "sfm", "points", "seeds", "render", "loss", "strategy")
TRAIN_KEYS = (
    "seed", "rates", "refine_poses", "random_background", "resolutions", "coarsest_px", "opacity_floor",
)  # fmt: skip
FREE = ("scene.gt_mesh", "scene.split", "scene.test_every", "render.threads")
# What runs had from before there was the setting; left out where it is the same, so that they go on.
ABSENT = {
    "render.device": "cpu", "scene.exposure": False,
    "train.random_background": False, "train.opacity_floor.until": 0, "primitive": "surfel2d",
}  # fmt: skip
# These say where things lie. What lies there counts (`contents`), or it follows from other settings.
LOCATIONS = ("scene.path", "points.file", "points.cache")
PHOTOS, POINTS_FILE = "photos", "given points"
VIEWS = "training views"
PRIORS = "prior maps"
CHUNK = 1 << 20


def fingerprint(config: Config, scene: Scene, priors: Mapping[str, ViewMaps] | None = None) -> dict[str, Any]:
    """Dotted key -> plain value of all settings that decide the result; digests of views, photos, points and priors.

    Raises:
        InputError: a photo or the file of points cannot be read.
    """
    values = asdict(config)
    values["scene"]["path"] = str(Path(config.scene.path).resolve())
    flat: dict[str, Any] = {"primitive": config.primitive}
    for section in SECTIONS:
        _flatten(section, values[section], flat)
    for key in TRAIN_KEYS:
        _flatten(f"train.{key}", values["train"][key], flat)
    if has_shares(config):
        flat["train.iterations"] = config.train.iterations
    for key, value in ABSENT.items():
        if flat[key] == value:
            flat.pop(key)
    if "train.opacity_floor.until" not in flat:
        flat.pop("train.opacity_floor.value")
    for key in FREE:
        flat.pop(key, None)
    flat[VIEWS] = _views_digest(scene)
    flat[PHOTOS] = hashlib.sha256(b"".join(frame.digest() for frame in scene.train)).hexdigest()[:16]
    if config.points.source == "file" and config.points.file:
        flat[POINTS_FILE] = _content(Path(config.points.file))
    if priors:
        flat[PRIORS] = priors_digest(priors, [frame.name for frame in scene.train])
    return flat


def digest(values: dict[str, Any]) -> str:
    """Sixteen hex digits that stand for a fingerprint."""
    values = {key: value for key, value in values.items() if key not in (PHOTOS, POINTS_FILE)}  # as it always was
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def check_same(before: dict[str, Any], now: dict[str, Any], where: Path) -> None:
    """Refuse to resume with other settings.

    Raises:
        InputError: names the first key that differs, with both values.
    """
    # what comes over JSON has lists where there may be tuples
    now = json.loads(json.dumps(now))
    before, now = _without_locations(before, now)
    # a key that only one has follows from another one that differs
    both = before.keys() & now.keys()
    last = ("", VIEWS, PHOTOS, POINTS_FILE, PRIORS)

    def order(key: str) -> tuple[int, bool, str]:
        return last.index(key) if key in last else 0, key not in both, key

    for key in sorted(before.keys() | now.keys(), key=order):
        if json.dumps(before.get(key)) == json.dumps(now.get(key)):  # 1, an iteration, is not 1.0, all of them
            continue
        if key == VIEWS:
            raise InputError(f"{where} was trained on other views than the scene has now; choose another out=DIR")
        if key in (PHOTOS, POINTS_FILE):
            raise InputError(f"{where} was trained with other {key} than there are now; choose another out=DIR")
        if key == PRIORS:
            raise InputError(f"{where} was trained with other depth or normal priors; choose another out=DIR")
        raise InputError(
            f"{where} was trained with {key}={before.get(key, ABSENT.get(key))}, so {key}="
            f"{now.get(key, ABSENT.get(key))} cannot resume it; give the old value or choose another out=DIR"
        )


def _without_locations(before: dict[str, Any], now: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Both without the settings that say where things lie, and without digests that an older run did not note."""
    locations = set(LOCATIONS)
    if PHOTOS not in before:
        locations -= {"scene.path", "points.file"}  # only the name tells what lay there
        locations |= {PHOTOS, POINTS_FILE}
    kept = [{key: value for key, value in one.items() if key not in locations} for one in (before, now)]
    return kept[0], kept[1]


def _content(path: Path) -> str:
    digest = hashlib.sha256()
    with open_regular(path) as file:
        while chunk := file.read(CHUNK):
            digest.update(chunk)
    return digest.hexdigest()[:16]


def _flatten(prefix: str, value: Any, into: dict[str, Any]) -> None:
    if isinstance(value, dict):
        for key, inner in value.items():
            _flatten(f"{prefix}.{key}", inner, into)
    else:
        into[prefix] = value


def _views_digest(scene: Scene) -> str:
    hasher = hashlib.sha256()
    for frame in scene.train:
        camera = frame.camera
        hasher.update(f"{frame.name} {camera.width} {camera.height}".encode())
        hasher.update(camera.K.tobytes())
        hasher.update(camera.cam_from_world.tobytes())
    return hasher.hexdigest()[:16]
