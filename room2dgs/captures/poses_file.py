"""Refined poses and a refined lens of a capture in a JSON file, with the given poses they belong to."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.in_metres import EstimatedUnit, unit_of_dict
from room2dgs.captures.lens import Lens
from room2dgs.captures.scene import Dropped, Frame, Scene
from room2dgs.captures.with_lens import with_focal, with_lens
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera
from room2dgs.regular_files import check_regular, read_regular

KIND = "room2dgs poses"
LEFT_OUT = "left_out"  # what a report calls the frames that take no part
UNIT = "unit"  # by which the capture was scaled; without it, it was not
LENS = "lens"  # and the lens that was found: model, params, size
FOCAL = "focal"  # and by what all focal lengths were multiplied
MOST_FOCAL = 2.0  # a factor, or its inverse, that a file may have
NO_POSE = "its photo does not tell its pose, and the given poses are off"
MEND = "delete it and start the run anew"
LONGEST, LONGEST_FRAME = 16 << 20, 16 << 10  # bytes of the file, and more of them for each frame
FARTHEST_M = 1e9
RIGID = 1e-6  # of R R^T - I: refined rotations are so to 1e-12
SAME = 1e-9  # given poses are read from text each time and are the same then


def with_cameras(scene: Scene, cameras: Mapping[str, Camera]) -> Scene:
    """The scene with other cameras for some of its frames, by name.

    Where one has moved, points that came with the capture no longer fit and are gone.
    """

    def changed(frames: Sequence[Frame]) -> tuple[Frame, ...]:
        return tuple(replace(frame, camera=cameras.get(frame.name, frame.camera)) for frame in frames)

    moved = any(
        frame.name in cameras and not np.array_equal(frame.camera.cam_from_world, cameras[frame.name].cam_from_world)
        for frame in scene.frames
    )
    points = None if moved else scene.given_points
    return replace(scene, train=changed(scene.train), test=changed(scene.test), given_points=points)


def without(scene: Scene, names: Collection[str]) -> Scene:
    """The scene without some of its frames, whose poses are not to be trusted."""
    if not names:
        return scene
    train, test = (tuple(one for one in frames if one.name not in names) for frames in (scene.train, scene.test))
    dropped = tuple(Dropped(one.name, NO_POSE) for one in scene.frames if one.name in names)
    return replace(scene, train=train, test=test, dropped=(*scene.dropped, *dropped))


def write_poses(
    path: Path, given: Scene, refined: Scene, report: Mapping[str, Any], unit: EstimatedUnit | None = None
) -> None:
    """cam_from_world of each frame, row by row, as given and as refined; digits enough for the same bits.

    Args:
        refined: frames that were left out of it are written as given; `report` names them.
        unit: that both scenes were scaled by.
    """
    after = {frame.name: frame.camera for frame in refined.frames}
    frames = {
        before.name: {
            "given": before.camera.cam_from_world.tolist(),
            "refined": after.get(before.name, before.camera).cam_from_world.tolist(),
        }
        for before in given.frames
    }
    scaled = {} if unit is None else {UNIT: unit.as_dict()}
    content = {"kind": KIND, "report": dict(report), **scaled, "cam_from_world": frames}
    text = json.dumps(content, indent=1, allow_nan=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_unit(path: Path, scene: Scene) -> EstimatedUnit | None:
    """What the capture was scaled by before its poses were written to a file: `read_poses` wants it scaled so.

    Raises:
        InputError: the file is missing, damaged or too large.
    """
    try:
        unit = json.loads(_raw(path, scene)).get(UNIT)
        return None if unit is None else unit_of_dict(unit)
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path} is not a file of refined poses; {MEND}") from error


def read_poses(path: Path, scene: Scene) -> tuple[Scene, dict[str, Any]]:
    """The scene with the refined poses, the lens and the focal length of a file, and what the file reports.

    Frames not in it keep their poses; those that its report calls left out are not in the scene.

    Raises:
        InputError: the file is missing, damaged or too large, holds poses that are not rigid or leaves out every
            photo, or belongs to other given poses.
    """
    raw = _raw(path, scene)
    try:
        content = json.loads(raw)
        report = dict(content["report"])
        poses = {
            name: (_matrix(two["given"]), _matrix(two["refined"])) for name, two in content["cam_from_world"].items()
        }
        lens, left_out = _lens(report.get(LENS), path), _names(report.get(LEFT_OUT) or ())
        focal = _factor(report.get(FOCAL))
        whole = content["kind"] == KIND
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
        whole = False
    if not whole:
        raise InputError(f"{path} is not a file of refined poses; {MEND}")
    for name, (_, refined) in poses.items():
        if not _is_rigid(refined):
            raise InputError(f"{path} gives {name} a pose that is not rigid; {MEND}")
    if lens:
        scene = with_lens(scene, lens)
    if focal != 1:
        scene = with_focal(scene, focal)
    cameras = {}
    for frame in scene.frames:
        if frame.name not in poses:
            continue
        given, refined = poses[frame.name]
        if np.abs(given - frame.camera.cam_from_world).max() > SAME:
            raise InputError(
                f"{path} was made for another pose of {frame.name} than {scene.path} has now; "
                "restore the capture's poses or start a new run"
            )
        cameras[frame.name] = replace(frame.camera, cam_from_world=refined)
    found = without(with_cameras(scene, cameras), left_out)
    if scene.train and not found.train:
        raise InputError(f"{path} leaves out every training photo; {MEND}")
    return found, report


def _raw(path: Path, scene: Scene) -> bytes:
    longest = LONGEST + len(scene.frames) * LONGEST_FRAME
    return read_regular(path, longest, MEND) if check_regular(path, MEND) else b""


def _matrix(rows: Any) -> np.ndarray:
    found = np.array(rows, dtype=np.float64)
    if found.shape != (4, 4) or not (np.abs(found) <= FARTHEST_M).all():
        raise ValueError
    return found


def _is_rigid(pose: np.ndarray) -> bool:
    rotation = pose[:3, :3]
    error = np.abs(rotation @ rotation.T - np.eye(3)).max()
    return bool(error <= RIGID and np.linalg.det(rotation) > 0 and (pose[3] == (0, 0, 0, 1)).all())


def _lens(found: Any, path: Path) -> Lens | None:
    if not found:
        return None
    width, height = map(int, found["size"])
    return Lens(str(found["model"]), tuple(map(float, found["params"])), (width, height), str(path))


def _factor(found: Any) -> float:
    factor = 1.0 if found is None else float(found)
    if not 1 / MOST_FOCAL <= factor <= MOST_FOCAL:
        raise ValueError
    return factor


def _names(found: Any) -> tuple[str, ...]:
    if not isinstance(found, list | tuple | dict) or not all(isinstance(name, str) for name in found):
        raise TypeError
    return tuple(found)
