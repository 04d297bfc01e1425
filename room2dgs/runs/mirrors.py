"""mirrors.json: the mirrors of a run's room, and what its views saw without what these show."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.world_offset import Origin
from room2dgs.errors import InputError
from room2dgs.json_files import read_json, update_json
from room2dgs.mirrors.mirror import Mirror, behind_glass, shown
from room2dgs.runs.folder import MIRRORS, TRUST
from room2dgs.runs.trust import Trust, read_trust

LARGEST_M = 1e9  # of a coordinate


def write_mirrors(path: Path, mirrors: Sequence[Mirror], origin_m: Origin) -> None:
    """Corners in the capture's own world, whole or not at all.

    Args:
        mirrors: scene's frame.
        origin_m: `Scene.origin_m`.
    """
    path.unlink(missing_ok=True)
    found = [
        {
            "corners_m": (one.corners + np.array(origin_m)).tolist(),
            "width_m": one.size_m[0],
            "height_m": one.size_m[1],
            "photos": one.photos,
        }
        for one in mirrors
    ]
    update_json(path, {"mirrors": found})


def read_mirrors(path: Path, origin_m: Origin) -> list[Mirror]:
    """In the scene's frame; none where there is no file.

    Raises:
        InputError: the file is damaged.
    """
    if not path.is_file():
        return []
    try:
        found = [
            Mirror(np.array(one["corners_m"], np.float64) - np.array(origin_m), int(one["photos"]))
            for one in read_json(path)["mirrors"]
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} holds no mirrors; mesh the run again") from error
    if not all(map(_is_rectangle, found)):
        raise InputError(f"{path} has a mirror that is no rectangle; mesh the run again")
    return found


def scaled_mirrors(path: Path, factor: float) -> dict[str, object]:
    """What a file of mirrors says at another scale.

    Raises:
        InputError: the file is damaged.
    """
    read_mirrors(path, (0.0, 0.0, 0.0))
    found = read_json(path)
    for one in found["mirrors"]:
        one["corners_m"] = (factor * np.array(one["corners_m"], np.float64)).tolist()
        one["width_m"], one["height_m"] = (float(factor * one[key]) for key in ("width_m", "height_m"))
    return found


def trusted_depths(out: Path, scene: Scene) -> dict[str, Trust]:
    """`read_trust` of a run, with the glass in place of what mirrors show.

    Raises:
        InputError: mirrors.json is damaged.
    """
    maps, mirrors = read_trust(out / TRUST), read_mirrors(out / MIRRORS, scene.origin_m)
    if not mirrors:
        return maps
    cameras = {frame.name: frame for frame in scene.frames}
    return {name: _without(one, cameras[name], mirrors) if name in cameras else one for name, one in maps.items()}


def _without(trust: Trust, frame: Frame, mirrors: Sequence[Mirror]) -> Trust:
    if trust.depth is None:
        return trust
    height, width = trust.depth.shape
    depth = trust.depth.astype(np.float32)
    glass = shown(depth, frame.camera.resized(width, height), mirrors)
    return trust._replace(depth=behind_glass(depth, glass).astype(np.float16))


def _is_rectangle(mirror: Mirror) -> bool:
    corners = mirror.corners
    if corners.shape != (4, 3) or not (np.abs(corners) < LARGEST_M).all():  # NaN is not
        return False
    wide, high = mirror.sides
    lengths = np.linalg.norm(wide), np.linalg.norm(high)
    if not min(lengths) > 0:
        return False
    square = abs(wide @ high) <= 1e-3 * lengths[0] * lengths[1]
    return bool(square and np.abs(corners[0] + wide + high - corners[2]).max() <= 1e-3 * max(lengths))
