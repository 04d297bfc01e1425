"""What another program made of a capture, scored as our own: its renderings of the held-out views, or its Gaussians."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from room2dgs.bench.splats import Point, held_out_scores, scores_of
from room2dgs.captures.image_files import read_photo
from room2dgs.captures.ply_elements import read_elements
from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.splat import Gaussians
from room2dgs.splat.constants import SH_DEGREE_OF

PICTURES = (".png", ".jpg", ".jpeg")
PROPERTIES = {"f_dc": 3, "scale": 3, "rot": 4}  # name -> how many of it a file has
SECONDS = re.compile(r"(\d+(?:\.\d+)?)(?:s|_.*)?")


class Other(NamedTuple):
    """A program's name and the folder of its results."""

    name: str
    folder: Path


def parsed(text: str) -> Other:
    """NAME:DIR.

    Raises:
        InputError: it is not of this form, or there is no such folder.
    """
    name, colon, folder = text.partition(":")
    if not (name and colon and folder):
        raise InputError(f"other={text} is not understood; write other=NAME:DIR")
    path = Path(folder).expanduser()
    if not path.is_dir():
        raise InputError(f"other={text}: {path} is no folder")
    return Other(name, path)


def other_points(other: Other, capture: str, scene: Scene, config: Config) -> list[Point]:
    """A point for each result in other's folder, or in its folder of the capture's name if there is one.

    A result is SECONDS.ply, Gaussians as 3DGS writes them in the world of the capture, or a folder SECONDS of
    pictures named as the held-out photos are; of a result whose name is no number the seconds are not known.

    Raises:
        InputError: nothing is there, a view's picture is missing or of another size, a file is damaged.
    """
    folder = other.folder / capture if (other.folder / capture).is_dir() else other.folder
    results = sorted(path for path in folder.iterdir() if path.is_dir() or path.suffix.lower() == ".ply")
    if any(path.suffix.lower() in PICTURES for path in folder.iterdir()):
        results = [folder]
    if not results:
        raise InputError(f"{folder} has neither pictures nor .ply files; other=NAME:DIR wants one of both")
    points = []
    for path in results:
        count = None
        if path.is_dir():
            scores = scores_of(_pictures(path, scene))
        else:
            gaussians = read_gaussians(path, scene.origin_m)
            scores, count = held_out_scores(gaussians, scene, config), len(gaussians.centers)
        found = SECONDS.fullmatch(path.stem if path.suffix.lower() == ".ply" else path.name)
        seconds = float(found[1]) if found else None
        points.append(
            Point(
                capture=capture, method=other.name, seconds=seconds, cpu_seconds=None, iteration=None,
                primitives=count, peak_memory_mb=None, preparation_seconds=None, **scores,
            )
        )  # fmt: skip
    return sorted(points, key=lambda point: (point.seconds is None, point.seconds or 0.0))


def _pictures(folder: Path, scene: Scene) -> Iterator[tuple[Frame, np.ndarray]]:
    by_stem = {path.stem: path for path in sorted(folder.iterdir()) if path.suffix.lower() in PICTURES}
    for frame in scene.test:
        path = by_stem.get(Path(frame.name).stem)
        if path is None:
            raise InputError(f"{folder} has no picture of the held-out view {frame.name}; name it {frame.name}.png")
        image = read_photo(path, None)
        size = (frame.camera.width, frame.camera.height)
        if image.shape[1::-1] != size:
            raise InputError(
                f"{path} is {image.shape[1]} x {image.shape[0]}, but the run works at {size[0]} x {size[1]}"
            )
        yield frame, image


def read_gaussians(path: Path, origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Gaussians:
    """Gaussians of a PLY in the layout of 3DGS, in the frame of a scene.

    Args:
        origin_m: `Scene.origin_m`.

    Raises:
        InputError: the file is damaged, or lacks a property.
    """
    rows = read_elements(path, ("vertex",))["vertex"].single
    rest = sum(name.startswith("f_rest_") for name in rows)
    needed = ["x", "y", "z", "opacity", *(f"{name}_{k}" for name, n in PROPERTIES.items() for k in range(n))]
    missing = [name for name in needed if name not in rows]
    if missing or rest // 3 + 1 not in SH_DEGREE_OF or rest % 3:
        lacks = f"has no {missing[0]}" if missing else f"has {rest} numbers f_rest"
        raise InputError(f"{path} {lacks}; a file of 3D Gaussians as 3DGS writes it is wanted")

    def columns(*names: str) -> torch.Tensor:
        return torch.from_numpy(np.stack([np.asarray(rows[name], np.float64) for name in names], axis=1))

    dc = columns("f_dc_0", "f_dc_1", "f_dc_2")[:, None]
    sh = [dc]
    if rest:
        by_channel = columns(*(f"f_rest_{k}" for k in range(rest))).reshape(len(dc), 3, rest // 3)
        sh.append(by_channel.transpose(1, 2))
    centers = columns("x", "y", "z") - torch.tensor(origin_m, dtype=torch.float64)
    parts = (
        centers,
        columns(*(f"rot_{k}" for k in range(4))),
        columns(*(f"scale_{k}" for k in range(3))).exp(),
        torch.sigmoid(columns("opacity")[:, 0]),
        torch.cat(sh, dim=1),
    )
    return Gaussians(*(part.float().contiguous() for part in parts))
