"""`room2dgs render`: photo, colour, depth and normals of a run's views side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.stages import read, rendered, trained_surfels, use_threads, with_poses_of_run
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log, run_log
from room2dgs.runs.folder import RENDERS, earlier_run
from room2dgs.runs.metrics import record, timed
from room2dgs.runs.pictures import depth_picture, normal_picture

if TYPE_CHECKING:
    from room2dgs.splat.types import Rendering, Surfels

USAGE = "room2dgs render out=DIR [views=test|train|all]"
VIEWS = ("test", "train", "all")
MIN_ALPHA = 0.5  # less covered pixels are drawn black in depth and normals


def main(argv: list[str]) -> int:
    """Draw an earlier run's held-out views (or its training views) beside the photos."""
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("render",))
    views, overrides = _views_argument(argv)
    config = earlier_run(overrides)
    out = Path(config.out)
    surfels = trained_surfels(out)
    render_scene(with_poses_of_run(read(config), out), surfels, config, out, run_log(out), {}, views)
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
                    write_png(out / RENDERS / name / f"{frame.name}.png", side_by_side(frame, rendering))
                    drawn += 1
    record(out, {}, seconds)
    log(f"renders: {drawn} pictures in {out / RENDERS} (photo, colour, depth, normal)")


def side_by_side(frame: Frame, rendering: Rendering) -> np.ndarray:
    """(H, 4 W, 3) uint8 RGB: photo, rendered colour, median depth, normals."""
    covered = (rendering.alpha >= MIN_ALPHA).numpy()
    color = np.round(rendering.color.clamp(0, 1).numpy() * 255).astype(np.uint8)
    depth = depth_picture(rendering.median_depth.numpy(), covered)
    normal = normal_picture(rendering.normal.numpy(), frame.camera, covered)
    return np.concatenate([frame.color(), color, depth, normal], axis=1)


def write_png(path: Path, rgb: np.ndarray) -> None:
    """Encode first, then write: a picture is there or it is not."""
    encoded = cv2.imencode(".png", rgb[..., ::-1])[1]
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        temporary.write_bytes(encoded.tobytes())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _views_argument(argv: list[str]) -> tuple[str, list[str]]:
    """`views=` is this command's own; the rest are settings."""
    views = "test"
    rest = []
    for argument in argv:
        key, _, value = argument.partition("=")
        if key != "views":
            rest.append(argument)
        elif value in VIEWS:
            views = value
        else:
            raise InputError(f"{argument} is not known; choose from {', '.join(VIEWS)}")
    return views, rest
