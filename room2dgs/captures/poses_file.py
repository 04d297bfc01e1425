"""Refined poses of a capture in a JSON file, beside the given ones that they belong to."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.geometry.camera import Camera

KIND = "room2dgs poses"
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


def write_poses(path: Path, given: Scene, refined: Scene, report: Mapping[str, Any]) -> None:
    """cam_from_world of each frame, row by row, as given and as refined; digits enough for the same bits."""
    frames = {
        before.name: {
            "given": before.camera.cam_from_world.tolist(),
            "refined": after.camera.cam_from_world.tolist(),
        }
        for before, after in zip(given.frames, refined.frames, strict=True)
    }
    text = json.dumps({"kind": KIND, "report": dict(report), "cam_from_world": frames}, indent=1, allow_nan=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_poses(path: Path, scene: Scene) -> tuple[Scene, dict[str, Any]]:
    """The scene with the refined poses of a file, and what the file reports; frames not in it stay as they are.

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
        whole = kind == KIND and all(m.shape == (4, 4) and np.isfinite(m).all() for two in poses.values() for m in two)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        whole = False
    if not whole:
        raise InputError(f"{path} is not a file of refined poses; delete it and start the run anew")
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
    return with_cameras(scene, cameras), report
