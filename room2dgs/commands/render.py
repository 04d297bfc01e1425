"""`room2dgs render`: photo, colour, depth and normals of a run's views side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.render_path import path_options, render_path
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import read, rendered, trained_surfels, use_threads, with_poses_of_run
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log, run_log
from room2dgs.runs.folder import RENDERS, at_work, earlier_run
from room2dgs.runs.metrics import record, timed
from room2dgs.runs.pictures import depth_picture, normal_picture, write_png

if TYPE_CHECKING:
    from room2dgs.splat.types import Rendering, Surfels

USAGE = """room2dgs render run=DIR [views=test|train|all]
room2dgs render run=DIR path=smooth|FILE [to=DIR] [save=color,depth,depth_npy,normals,video]
                        [frames=N] [through=N] [fps=N] [width=N]"""
VIEWS = ("test", "train", "all")
MIN_ALPHA = 0.5  # less covered pixels are drawn black in depth and normals
OWN = ("views", "path", "to", "save", "frames", "fps", "width", "through")  # arguments that are no settings


def main(argv: list[str]) -> int:
    """Draw an earlier run: its held-out views (or training views) beside the photos; or, with path=, what cameras see
    along a smooth path through the captured views (path=smooth), or from a camera file (path=FILE: a transforms.json,
    or a folder with a COLMAP model, in the world of the run).

    save= says what of a path is written to to=DIR (RUN/renders/NAME): color (PNG), depth (16-bit PNG, millimetres),
    depth_npy (float32, metres), normals (PNG), video (MP4 of the colours); color,video unless said otherwise.
    frames= (240) and through= (12 of the captured views) are a smooth path's; fps= (30) the video's; width= in pixels.
    """
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("render",))
    own, overrides = own_arguments(argv, OWN)
    views = own.get("views", "test")
    if views not in VIEWS:
        raise InputError(f"views={views} is not known; choose from {', '.join(VIEWS)}")
    path = path_options(own)
    config = earlier_run(overrides)
    with at_work(config) as out:
        surfels = trained_surfels(out)
        scene = with_poses_of_run(read(config), out)
        if path is not None:
            render_path(path, scene, surfels, config, out, run_log(out))
        else:
            render_scene(scene, surfels, config, out, run_log(out), {}, views)
    return 0


def render_scene(
    scene: Scene,
    surfels: Surfels,
    config: Config,
    out: Path,
    log: Log,
    seconds: dict[str, float],
    views: str = "test",
) -> None:
    """renders/<test|train>/<view>.png of the views."""
    use_threads(config)
    drawn = 0
    with timed(seconds, "render"):
        for name, frames in (("test", scene.test), ("train", scene.train)):
            if views in (name, "all"):
                for frame, rendering in rendered(surfels, frames, config):
                    write_png(out / RENDERS / name / f"{frame.name}.png", parallel_map(frame, rendering))
                    drawn += 1
    record(out, {}, seconds)
    log(f"renders: {drawn} pictures in {out / RENDERS} (photo, colour, depth, normal)")


def parallel_map(frame: Frame, rendering: Rendering) -> np.ndarray:
    """(H, 4 W, 3) uint8 RGB: photo, rendered colour, median depth, normals."""
    covered = (rendering.alpha >= MIN_ALPHA).numpy()
    color = np.round(rendering.color.clamp(0, 1).numpy() * 255).astype(np.uint8)
    depth = depth_picture(rendering.median_depth.numpy(), covered)
    normal = normal_picture(rendering.normal.numpy(), frame.camera, covered)
    return np.concatenate([frame.color(), color, depth, normal], axis=1)
