"""The priors that a run has worked out, in its folder until it ends: a run that is killed later goes on with them."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs import __version__
from room2dgs.blame import by_the_machine
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.captures.stored_maps import StoredMaps
from room2dgs.config import Config
from room2dgs.depth import Priors
from room2dgs.depth.align.scale_shift import Fit
from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE, whole_folder
from room2dgs.logs import Log

INDEX = "index.json"
FORMAT = 1
ARRAYS = 4  # of a view, as `packed_maps` has them


def key_of(scene: Scene, points: PointCloud, config: Config) -> str:
    """Stands for all that priors are made of: photos, poses, points, settings, and the files that settings name."""
    from room2dgs.sfm.sparse import digest_of_views

    settings = asdict(config.prior) | {"cache": None}
    capture = asdict(config.scene) | {"gt_mesh": None}
    del capture["exposure"]  # it is found with the priors, and changes none
    others = [FORMAT, __version__, settings, asdict(config.stereo), capture, config.render.device]
    views = digest_of_views((*scene.keyframes, None, *scene.beside), config.points, [repr(others)])
    digest = hashlib.sha256(views.encode())
    tracks = points.tracks
    known = (points.xyz, points.weight, *((tracks.frame, tracks.point, tracks.pixel) if tracks else ()))
    for array in known:
        digest.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
    folders = (Path(path) for path in (config.prior.depth.path, config.prior.normal.path) if path)
    for path in (*(frame.depth_path for frame in scene.keyframes if frame.depth_path), *_files(folders)):
        found = os.stat(path)
        digest.update(f"{path} {found.st_size} {found.st_mtime_ns}".encode(errors="surrogateescape"))
    return digest.hexdigest()[:32]


def keep_priors(folder: Path, key: str, priors: Priors, log: Log) -> None:
    """Keep priors for `kept_priors`. A disk that has no room for them is no reason to stop."""
    maps = priors.by_frame
    names = list(maps)
    index = {
        "key": key,
        "views": [{"name": name, "source": maps.source(name), "digest": maps.digest(name)} for name in names],
        "fits": {name: list(fit) for name, fit in priors.fits.items()},
        "label": priors.label,
        "networks": priors.networks,
        "depth_source": priors.depth_source,
    }
    try:
        with whole_folder(folder) as partial:
            for number, name in enumerate(names):
                with (partial / _file(number)).open("wb") as file:
                    for array in maps.packed(name):
                        np.save(file, array)
            (partial / INDEX).write_text(json.dumps(index), encoding="utf-8")
    except InputError as error:
        if not by_the_machine(error):
            raise
        log(f"priors are not kept for a run that goes on: {error}")


def kept_priors(folder: Path, key: str, scene: Scene) -> Priors | None:
    """The very maps that `keep_priors` kept, in the scene's cache; None if there are none for this key, or damaged."""
    try:
        index = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        if index["key"] != key:
            return None
        maps = StoredMaps(scene.cache)
        for number, view in enumerate(index["views"]):
            maps.put_packed(view["name"], _read(folder / _file(number)), view["source"])
            if maps.digest(view["name"]) != view["digest"]:
                return None
        fits = {name: Fit(*fit) for name, fit in index["fits"].items()}
        return Priors(maps, fits, index["label"], index["networks"], index["depth_source"])
    except (InputError, AttributeError, *NUMPY_DAMAGE):
        return None


def _read(path: Path) -> tuple[Any, ...]:
    with path.open("rb") as file:
        return tuple(np.load(file, allow_pickle=False) for _ in range(ARRAYS))


def _file(number: int) -> str:
    return f"{number:06d}.npy"


def _files(places: Iterator[Path]) -> Iterator[Path]:
    """The files themselves, or those in the folders."""
    for place in places:
        if place.is_dir():
            yield from sorted(path for path in place.iterdir() if path.is_file())
        elif place.is_file():
            yield place
