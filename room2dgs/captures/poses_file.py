"""Refined poses of a capture, and a lens that was found, in a JSON file, beside the given poses that they belong to."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.lens import Lens
from room2dgs.captures.scene import Dropped, Frame, Scene
from room2dgs.captures.with_lens import with_lens
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera

KIND = "room2dgs poses"
LEFT_OUT = "left_out"  # what a report calls the frames that take no part
LENS = "lens"  # and the lens that was found: model, params, size
NO_POSE = "its photo does not tell its pose, and the given poses are off"
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


def write_poses(path: Path, given: Scene, refined: Scene, report: Mapping[str, Any]) -> None:
    """cam_from_world of each frame, row by row, as given and as refined; digits enough for the same bits.

    Args:
        refined: frames that were left out of it are written as given; `report` names them.
    """
    after = {frame.name: frame.camera for frame in refined.frames}
    frames = {
        before.name: {
            "given": before.camera.cam_from_world.tolist(),
            "refined": after.get(before.name, before.camera).cam_from_world.tolist(),
        }
        for before in given.frames
    }
    text = json.dumps({"kind": KIND, "report": dict(report), "cam_from_world": frames}, indent=1, allow_nan=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_poses(path: Path, scene: Scene) -> tuple[Scene, dict[str, Any]]:
    """The scene with the refined poses and the lens of a file, and what the file reports.

    Frames not in it keep their poses; those that its report calls left out are not in the scene.

    Raises:
        InputError: the file is missing, damaged, or belongs to other given poses.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        kind, report = content["kind"], dict(content["report"])
        poses = {
            name: tuple(np.array(pose[which], dtype=np.float64) for which in ("given", "refined"))
            for name, pose in content["cam_from_world"].items()
        }
        found = report.get(LENS)
        lens = found and Lens(str(found["model"]), tuple(map(float, found["params"])), tuple(map(int, found["size"])))
        whole = kind == KIND and all(m.shape == (4, 4) and np.isfinite(m).all() for two in poses.values() for m in two)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        whole = False
    if not whole:
        raise InputError(f"{path} is not a file of refined poses; delete it and start the run anew")
    if lens:
        scene = with_lens(scene, replace(lens, source=str(path)))
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
    return without(with_cameras(scene, cameras), report.get(LEFT_OUT, ())), report
