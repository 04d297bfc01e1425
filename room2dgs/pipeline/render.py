"""Pictures of a run's views beside the photos."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.surfels import render_frames, use_threads
from room2dgs.runs.folder import RENDERS
from room2dgs.runs.pictures import depth_picture, normal_picture, write_png

if TYPE_CHECKING:
    from room2dgs.primitives.primitive import Splats
    from room2dgs.splat.types import Rendering

VIEWS = ("test", "train", "all")


def write_renders(scene: Scene, surfels: Splats, config: Config, run: RunFolder, views: str = "test") -> None:
    """renders/<test|train>/<view>.png: photo, colour, depth and normals of each view.

    Args:
        views: of `VIEWS`: the held-out ones, the training ones, or both.
    """
    use_threads(config)
    drawn = 0
    with run.timed("render"):
        for name, frames in (("test", scene.test), ("train", scene.train)):
            if views in (name, "all"):
                for frame, rendering in render_frames(surfels, frames, config):
                    picture = comparison_picture(frame, rendering)
                    write_png(run.path / RENDERS / name / f"{frame.name}.png", picture)
                    drawn += 1
    run.record()
    run.log(f"renders: {drawn} pictures in {run.path / RENDERS} (photo, colour, depth, normal)")


def comparison_picture(frame: Frame, rendering: Rendering) -> np.ndarray:
    """(H, 4 W, 3) uint8 RGB: photo, rendered colour, median depth, normals."""
    covered = rendering.covered.numpy()
    color = np.round(rendering.color.clamp(0, 1).numpy() * 255).astype(np.uint8)
    depth = depth_picture(rendering.median_depth.numpy(), covered)
    normal = normal_picture(rendering.normal.numpy(), frame.camera, covered)
    return np.concatenate([frame.color(), color, depth, normal], axis=1)
